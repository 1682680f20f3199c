//! Incompressible finite-volume Navier-Stokes on node pairs.
