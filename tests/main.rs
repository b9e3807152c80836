mod energies;
mod kernels;
mod mapping;
