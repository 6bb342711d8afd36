//! The folder of a prepared patient: manifest with hashes, VTU, PLY and Slicer markups.
