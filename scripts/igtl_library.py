"""The reference C++ library of OpenIGTLink as a program (oracle_igtl.cpp), for the oracles that need it."""

import pathlib
import shutil
import subprocess

from oracle import ROOT


def compiled(folder):
    """Path of the program, made in `folder`; None, said once, where the library or a compiler is missing."""
    if not pathlib.Path("/usr/include/openigtlink/igtlMessageBase.h").exists() or not shutil.which("g++"):
        print("skipped: no libopenigtlink-dev (apt-get install libopenigtlink-dev g++)")
        return None
    program = f"{folder}/oracle"
    source = str(ROOT / "scripts" / "oracle_igtl.cpp")
    flags = ["-std=c++17", "-w", "-I/usr/include/openigtlink", "-o", program, source, "-lOpenIGTLink", "-lpthread"]
    subprocess.run(["g++", *flags], check=True)
    return program


def split(data):
    """Messages of a stream; the last one may be cut off."""
    out = []
    while data:
        end = 58 + int.from_bytes(data[42:50], "big")
        out.append(data[:end])
        data = data[end:]
    return out
