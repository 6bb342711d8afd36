"""Foreign OpenIGTLink peers against the product itself: the port beside a live session, and `monro track`.

pyigtl listens to a session of a made-up head (the reference C++ library of Debian cannot: it knows no header of version
2, which the status of a pose needs); then pyigtl's server, and the library's own TDATA, QTDATA and POSITION over a socket
(see oracle_igtl.py), are tracked by the command.

    python scripts/oracle_igtl_live.py [--monro PATH]
"""

import contextlib
import json
import socket
import subprocess
import tempfile
import threading
import time
import urllib.request

import numpy as np
import pyigtl

from oracle import binary, check, example, finish, free_port
from igtl_library import compiled, split

MONRO = binary(__doc__)


@contextlib.contextmanager
def session():
    """A live session of a made-up head: what it prints when it is ready."""
    process = subprocess.Popen([example("serve_ellipsoid")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        yield json.loads(process.stdout.readline())
    finally:
        process.kill()
        process.wait()


def asked(ready, path):
    request = urllib.request.Request(ready["url"] + path, headers={"Authorization": "Bearer " + ready["token"]})
    with urllib.request.urlopen(request, timeout=5) as answer:
        return json.load(answer)


def check_shown(ready):
    """What pyigtl receives agrees with the web interface."""
    host, port = ready["igtl"].rsplit(":", 1)
    client = pyigtl.OpenIGTLinkClient(host=host, port=int(port))
    got = {name: client.wait_for_message(name, timeout=10) for name in ("Catheter", "Plan", "Guidance")}
    check("catheter, plan and numbers are received", all(got.values()), str(got))
    tip = got["Catheter"].matrix
    check("the catheter's pose is a rotation", np.allclose(tip[:3, :3] @ tip[:3, :3].T, np.eye(3), atol=1e-5), str(tip))
    check("its status is told", "TransformStatus" in got["Catheter"].metadata, str(got["Catheter"].metadata))
    plan = asked(ready, "/api/case")["plan"]
    entry, target = (np.array(plan[k]) * [-1, -1, 1] for k in ("entry_lps_mm", "target_lps_mm"))
    points = np.array(got["Plan"].positions)
    check("entry and target are those of the case, RAS", np.allclose(points[:2], [entry, target], atol=1e-3), str(points))
    check("numbers in words", "mm" in got["Guidance"].string, got["Guidance"].string)
    client.stop()


def crc64(data):
    """CRC-64 of ECMA-182, as OpenIGTLink has it, bit by bit."""
    crc = 0
    for byte in data:
        crc ^= byte << 56
        for _ in range(8):
            crc = (crc << 1 ^ (0x42F0E1EBA9EA3693 if crc >> 63 else 0)) & (1 << 64) - 1
    return crc


def check_bytes(ready):
    """Two seconds of the stream: every kind is there, checksums are right, surfaces are not sent too often."""
    host, port = ready["igtl"].rsplit(":", 1)
    data = b""
    with socket.create_connection((host, int(port)), timeout=5) as stream:
        until = time.time() + 2
        while time.time() < until:
            data += stream.recv(1 << 20)
    whole = [m for m in split(data) if len(m) >= 58 and len(m) == 58 + int.from_bytes(m[42:50], "big")]
    kinds = {}
    for m in whole:
        kinds.setdefault(m[2:14].rstrip(b"\0").decode(), []).append(m)
    for kind in ("TRANSFORM", "POLYDATA", "POINT", "STRING", "STATUS"):
        first = kinds.get(kind, [bytes(58)])[0]
        check(f"{kind} comes with its checksum", first[58:] and crc64(first[58:]) == int.from_bytes(first[50:58], "big"))
    shapes, poses = len(kinds.get("POLYDATA", [])), len(kinds.get("TRANSFORM", []))
    check("surfaces come at most ten times a second, poses more often", shapes <= 21 < poses, f"{shapes} {poses}")


def tracked(port, frames, query=""):
    """The first pose of each name that `monro track` prints: what comes again with the same time is none any more."""
    command = [MONRO, "track", f"igtl://127.0.0.1:{port}{query}", "--frames", str(frames), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    poses = [json.loads(line) for line in done.stdout.splitlines()]
    check("tracking ends well", done.returncode == 0, done.stderr[-300:])
    return {p["name"]: p for p in reversed(poses)}


def check_tracked_pyigtl():
    port = free_port()
    server = pyigtl.OpenIGTLinkServer(port=port, local_server=True)
    pose = np.array([[1, 0, 0, 10.5], [0, 0, -1, -20.25], [0, 1, 0, 30.125], [0, 0, 0, 1]], dtype=np.float32)
    stop = threading.Event()

    def send():
        while not stop.is_set():
            server.send_message(pyigtl.TransformMessage(pose, device_name="StylusToReference"), wait=False)
            time.sleep(0.02)

    threading.Thread(target=send, daemon=True).start()
    check_pose(tracked(port, 10), "StylusToReference", [10.5, -20.25, 30.125], [0.5**0.5, 0.5**0.5, 0, 0])
    stop.set()
    server.stop()


def check_pose(poses, name, position, quaternion):
    pose = poses.get(name, {})
    near = np.allclose(pose.get("position_mm", np.nan), position, atol=1e-4)
    turned = abs(np.dot(pose.get("quaternion_wxyz", [np.nan] * 4), quaternion)) > 1 - 1e-6
    check(f"{name} is where it is, and live", near and turned and pose.get("state") == "live", str(pose))


def check_tracked_library(library):
    """TDATA, QTDATA and POSITION as the reference library packs them, over a socket that waits to be asked."""
    packed = split(subprocess.run([library, "pack"], capture_output=True, check=True).stdout)
    kinds = {m[2:14].rstrip(b"\0").decode(): m for m in packed}
    for kind, query, name, position in (
        ("TDATA", "?start=TDATA", "Catheter", [10.5, -20.25, 30.125]),
        ("QTDATA", "?start=QTDATA", "Stylus", [1, 2, 3]),
        ("POSITION", "", "Tip", [1, 2, 3]),
    ):
        listener = socket.create_server(("127.0.0.1", 0))
        heard = []
        serve = threading.Thread(target=stream, args=(listener, kinds[kind], query != "", heard), daemon=True)
        serve.start()
        turn = [0.5**0.5, 0.5**0.5, 0, 0] if kind == "TDATA" else [0.8, 0, 0, 0.6]
        check_pose(tracked(listener.getsockname()[1], 5, query), name, position, turn)
        if query:
            check(f"it was asked with STT_{kind}", heard and heard[0][2:14].startswith(f"STT_{kind}".encode()), str(heard))
        listener.close()


def stream(listener, message, wait, heard):
    peer, _ = listener.accept()
    with contextlib.suppress(OSError), peer:
        if wait:
            heard.append(peer.recv(4096))
        while True:
            peer.sendall(message)
            time.sleep(0.02)


with tempfile.TemporaryDirectory() as folder:
    library = compiled(folder)
    with session() as ready:
        check_shown(ready)
        check_bytes(ready)
    check_tracked_pyigtl()
    if library:
        check_tracked_library(library)
finish()
