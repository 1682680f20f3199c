//! Linear algebra the fluid needs: pair matrix, conjugate gradients, algebraic multigrid.
