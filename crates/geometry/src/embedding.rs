//! Binding of surface points to tetrahedra (the hybrid model).
