"""Foreign OpenIGTLink peers against the crate `wire`: pyigtl over real sockets, and the reference C++ library.

pyigtl acts as server and as client; our codec (the example igtl_filter) sits at the other end and sends every message
back as it understood it. The C++ library (Debian package libopenigtlink-dev) packs messages of kinds that pyigtl has not,
which must come back byte for byte, and reads ours with its own checksum. Without the package that half is skipped.

    python scripts/oracle_igtl.py
"""

import socket
import subprocess
import tempfile
import threading
import time

import numpy as np
import pyigtl

from oracle import check, example, finish, free_port
from igtl_library import compiled, split


def run(arguments, data=b""):
    done = subprocess.run(arguments, input=data, capture_output=True)
    return done.returncode, done.stdout, done.stderr.decode(errors="replace")


def messages(data):
    """Cuts bytes into messages of pyigtl; kinds that it does not know are given by their type name."""
    out = []
    while data:
        header = pyigtl.messages.MessageBase.parse_header(data[:58])
        body, data = data[58 : 58 + header["body_size"]], data[58 + header["body_size"] :]
        message = pyigtl.messages.MessageBase.create_message(header["message_type"])
        if message:
            message.unpack(header, body)
        out.append((header["message_type"], message))
    return out


def theirs(version):
    """One message of each kind that pyigtl makes as the protocol says (its POSITION is a list of its own, 152 bytes)."""
    pose = np.array([[1, 0, 0, 10.5], [0, 0, -1, -20.25], [0, 1, 0, 30.125], [0, 0, 0, 1]], dtype=np.float32)
    voxels = np.arange(24, dtype=np.int16).reshape(2, 3, 4) * 100 - 1024
    made = [
        pyigtl.TransformMessage(pose, device_name="StylusToReference", timestamp=1700000000.5),
        pyigtl.StringMessage("1.25 mm", device_name="EntryError", timestamp=1700000000.5),
        pyigtl.PointMessage([[1, 2, 3], [4, 5.5, -6]], names=["Entry", "Target"], groups="Fiducial", device_name="Plan"),
        pyigtl.ImageMessage(voxels, pose, "ras", device_name="Slice"),
    ]
    for i, m in enumerate(made):
        m.header_version = version
        if version == 2:
            m.message_id = i + 1
            m.metadata = {"TransformStatus": "OK", "Note": "x" * i}
    return made


def check_bytes():
    for version in (1, 2):
        for m in theirs(version):
            sent = m.pack()
            code, back, error = run([FILTER, "echo"], sent)
            check(f"{m.message_type} v{version} comes back byte for byte", code == 0 and back == sent, error)
        code, _, error = run([FILTER, "echo"], theirs(version)[0].pack()[:-1] + b"\x55")
        check("a damaged body is refused by name", code == 1 and "checksum" in error.lower(), error)


def check_reading():
    for version in (1, 2):
        _, data, error = run([FILTER, "emit", str(version)])
        found = {kind: m for kind, m in messages(data) if m is not None}
        check("pyigtl reads ours", {"TRANSFORM", "STRING", "POINT", "IMAGE"} <= set(found), error)
        c, s = np.cos(0.5), np.sin(0.5)
        expected = [[1, 0, 0, 10.5], [0, c, -s, -20.25], [0, s, c, 30.125], [0, 0, 0, 1]]
        check("transform", np.allclose(found["TRANSFORM"].matrix, expected, atol=1e-6))
        check("time", found["TRANSFORM"].timestamp == 1700000000.5)
        check("string", found["STRING"].string == "1.25 mm")
        points = found["POINT"]
        check("points", points.names == ["Entry", "Target"] and points.positions[1] == (4.0, 5.5, -6.0))
        image = found["IMAGE"]
        check("voxels", np.array_equal(image.image.ravel(), np.arange(24) * 100 - 1024))
        check("first voxel", np.allclose(image.ijk_to_world_matrix[:3, 3], [-10, 20, 30], atol=1e-5))
        wanted = {"Status": "OK", "Note": "grün"} if version == 2 else {}
        check("metadata", found["TRANSFORM"].metadata == wanted, str(found["TRANSFORM"].metadata))


def whole_message(stream):
    """The next message of our codec's output with its header (58 bytes, the body's length at 42); empty at its end."""

    def exactly(count):
        data = b""
        while len(data) < count and (piece := stream.read(count - len(data))):
            data += piece
        return data

    header = exactly(58)
    return header + exactly(int.from_bytes(header[42:50], "big"))


def relay(connection):
    """Lets our codec sit at a socket: what comes goes through it and back.

    Back it goes a message at a time: our codec's standard output breaks off behind every byte 10, and pyigtl loses the
    beginning of a header whose rest is not there within 10 ms, as on a busy machine.
    """
    process = subprocess.Popen([FILTER, "echo"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)

    def forth():
        try:
            while data := connection.recv(4096):
                process.stdin.write(data)
        except OSError:
            pass
        process.stdin.close()

    def back():
        while data := whole_message(process.stdout):
            try:
                connection.sendall(data)
            except OSError:
                return

    for work in (forth, back):
        threading.Thread(target=work, daemon=True).start()


def same(a, b):
    if a is None or b is None or a.message_type != b.message_type or a.metadata != b.metadata:
        return False
    for name in ("matrix", "string", "image", "ijk_to_world_matrix"):
        if hasattr(a, name) and not np.array_equal(getattr(a, name), getattr(b, name)):
            return False
    return not hasattr(a, "positions") or np.allclose(a.positions, b.positions)


def check_sockets():
    port = free_port()
    server = pyigtl.OpenIGTLinkServer(port=port, local_server=True)
    connection = socket.create_connection(("127.0.0.1", port), timeout=5)
    connection.settimeout(None)
    relay(connection)
    exchange("pyigtl server", server)
    connection.close()
    server.stop()

    listener = socket.create_server(("127.0.0.1", 0))
    client = pyigtl.OpenIGTLinkClient(host="127.0.0.1", port=listener.getsockname()[1])
    accepted, _ = listener.accept()
    relay(accepted)
    exchange("pyigtl client", client)
    client.stop()
    listener.close()


def exchange(name, peer):
    deadline = time.time() + 5
    while not peer.is_connected() and time.time() < deadline:
        time.sleep(0.01)
    for version in (1, 2):
        for sent in theirs(version):
            peer.send_message(sent)
            got = peer.wait_for_message(sent.device_name, timeout=2)
            check(f"{name}: {sent.message_type} v{version} through a socket and back", same(sent, got), str(got))


EXPECTED = """TRANSFORM StylusToReference 10.5 -20.25 30.125 0.4794
POSITION Tip 10.5 -20.25 30.125 0.2474 0.9689
TDATA Tools 1 Stylus 2 30.125 0.4794
QTDATA QTools Stylus 2 30.125 0.2474
STATUS Health 13 -7 LOST stylus not seen
STRING EntryError 1.25 mm
POINT Plan 2 Target Fiducial 4 5.5 -6 2.5
TRAJ Path EVD 3 3 6
POLYDATA Brain 4 4 -10 shift 4
IMAGE Slice 4 3 2 -9.25 20.5 31 1276
"""


def check_reference_library():
    with tempfile.TemporaryDirectory() as folder:
        program = compiled(folder)
        if not program:
            return
        _, packed, _ = run([program, "pack"])
        code, back, error = run([FILTER, "echo"], packed)
        check("every message of the reference library is read", code == 0, error)
        for sent, got in zip(split(packed), split(back)):
            kind = sent[2:14].rstrip(b"\0").decode()
            if kind == "QTDATA":
                # The library leaves one padding byte as it finds it in memory; ours is 0, and the checksum differs with it.
                sent, got = (m[:50] + m[58:79] + m[80:] for m in (sent, got))
            check(f"{kind} of the reference library comes back byte for byte", sent == got)
        check("none is missing", len(split(packed)) == len(split(back)) == 10)
        _, ours, _ = run([FILTER, "emit", "1"])
        code, text, _ = run([program, "check"], ours)
        for wanted, got in zip(EXPECTED.splitlines(), text.decode().splitlines()):
            check(f"the reference library reads our {wanted.split()[0]}", wanted == got, f"{got!r}")
        check("it reads all of them", code == 0 and len(text.splitlines()) == 10)


FILTER = example("igtl_filter")
check_bytes()
check_reading()
check_sockets()
check_reference_library()
finish()
