//! Bytes to timed poses and meshes and back (NatNet, OpenIGTLink), sans-I/O.
