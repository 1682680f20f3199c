"""PETSc's own conjugate gradients on a matrix that the example `poisson` wrote: poisson_petsc.py FILE TOLERANCE OPTIONS...

Runs under the system's Python (Debian packages python3-petsc4py-real, libhypre). OPTIONS are PETSc's; prints one line of CSV:
iterations, set-up [s], solve [s] (the best of three each), true relative residual, PETSc's reason to stop (positive: converged).
"""

import glob
import sys
import time

sys.path += sorted(glob.glob("/usr/lib/petscdir/*/x86_64-linux-gnu-real/lib/python3/dist-packages"))
import petsc4py

if sys.argv[1] == "--version":
    from petsc4py import PETSc

    PETSc.PC().create().setType("hypre")
    print("PETSc {}.{}.{} with hypre".format(*PETSc.Sys.getVersion()))
    sys.exit(0)
path, tolerance = sys.argv[1], float(sys.argv[2])
petsc4py.init(["poisson", *sys.argv[3:]])
from petsc4py import PETSc

REPEATS = 3


def main():
    viewer = PETSc.Viewer().createBinary(path, "r")
    matrix = PETSc.Mat().load(viewer)
    rhs = PETSc.Vec().load(viewer)
    constant = PETSc.NullSpace().create(constant=True)
    matrix.setNullSpace(constant)
    matrix.setOption(PETSc.Mat.Option.SPD, False)
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    set_up = solve = float("inf")
    for _ in range(REPEATS):
        solver = PETSc.KSP().create()
        solver.setType("cg")
        solver.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        solver.setOperators(matrix)
        solver.setTolerances(rtol=tolerance, atol=0.0, max_it=2000)
        solver.setFromOptions()
        PETSc.COMM_WORLD.barrier()
        start = time.perf_counter()
        solver.setUp()
        set_up = min(set_up, time.perf_counter() - start)
        answer = rhs.duplicate()
        answer.set(0.0)
        start = time.perf_counter()
        solver.solve(rhs, answer)
        solve = min(solve, time.perf_counter() - start)
        iterations, reason = solver.getIterationNumber(), solver.getConvergedReason()
        rest = rhs - matrix * answer
        residual = rest.norm() / rhs.norm()
        solver.destroy()
    if PETSc.COMM_WORLD.rank == 0:
        print(f"{iterations},{set_up:.4f},{solve:.4f},{residual:.2e},{reason}")


main()
