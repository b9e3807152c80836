//! Distortion energies: densities over the 3x3 Jacobian of a map, one file each, one list.
