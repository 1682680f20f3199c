"""OpenFOAM cases written, run and read: only what the benches need.

Traps of the Debian package (1912): solvers refuse to start without WM_PROJECT_DIR, which the packaged `share/openfoam`
is enough for (its etc/bashrc calls scripts that Debian leaves out); there is no compiler tree, so initial fields come from
here; icoFoam freezes the convecting flux of the last step (first order), pimpleFoam with two outer iterations does not.
"""

import os
import pathlib
import re
import shutil
import subprocess
import time

import harness
import numpy as np

HEADER = "FoamFile {{ version 2.0; format ascii; class {}; object {}; }}\n"
# Corners of the block: 0–3 around z low, 4–7 above them.
FACES = {
    "x_min": "(0 4 7 3)", "x_max": "(1 2 6 5)", "y_min": "(0 1 5 4)",
    "y_max": "(3 7 6 2)", "z_min": "(0 3 2 1)", "z_max": "(4 5 6 7)",
}
CENTRAL = """ddtSchemes { default backward; }
gradSchemes { default Gauss linear; }
divSchemes { default Gauss linear; }
laplacianSchemes { default Gauss linear orthogonal; }
interpolationSchemes { default linear; }
snGradSchemes { default orthogonal; }
"""


def installed():
    return shutil.which("pimpleFoam") is not None and shutil.which("blockMesh") is not None


def environment():
    share = pathlib.Path(shutil.which("pimpleFoam")).resolve().parents[1] / "share" / "openfoam"
    return harness.environment() | {"WM_PROJECT_DIR": str(share), "WM_PROJECT": "OpenFOAM", "WM_PROJECT_VERSION": "v1912"}


def write(case, path, kind, body):
    file = case / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(HEADER.format(kind, file.name) + body + "\n")


def vectors(case, name, dimensions, values, boundary):
    """Nonuniform vector field, cells numbered along x first."""
    body = "\n".join(f"({u:.15g} {v:.15g} {w:.15g})" for u, v, w in values)
    text = f"dimensions {dimensions};\ninternalField nonuniform List<vector>\n{len(values)}\n(\n{body}\n);\n"
    write(case, f"0/{name}", "volVectorField", text + "boundaryField {\n" + boundary + "\n}")


def block(case, low, high, cells, patches):
    """One block of equal cells; `patches` is the text of the boundary, faces named as in FACES."""
    for name, corners in FACES.items():
        patches = patches.replace(f"<{name}>", corners)
    plane = [(0, 0), (1, 0), (1, 1), (0, 1)]
    ends = [low, high]
    corners = [(ends[i][0], ends[j][1], ends[k][2]) for k in (0, 1) for i, j in plane]
    points = " ".join("({:.17g} {:.17g} {:.17g})".format(*corner) for corner in corners)
    count = "({} {} {})".format(*cells)
    write(case, "system/blockMeshDict", "dictionary", f"""convertToMeters 1;
vertices ({points});
blocks (hex (0 1 2 3 4 5 6 7) {count} simpleGrading (1 1 1));
edges (); boundary ({patches}); mergePatchPairs ();""")
    tool(case, "blockMesh")


def cyclic(axis):
    """A periodic pair of patches."""
    pair = [f"{axis}_min", f"{axis}_max"]
    each = "{0} {{ type cyclic; neighbourPatch {1}; faces (<{0}>); }}"
    return each.format(*pair) + "\n" + each.format(*reversed(pair)) + "\n"


def move_points(case, place):
    """Gives every point of the mesh a new position; `place` maps an array (points, 3)."""
    path = case / "constant" / "polyMesh" / "points"
    text = path.read_text()
    found = list(re.finditer(r"^\((\S+) (\S+) (\S+)\)$", text, re.M))
    points = place(np.array([[float(x) for x in match.groups()] for match in found]))
    body = "\n".join("({:.16g} {:.16g} {:.16g})".format(*point) for point in points)
    path.write_text(text[: found[0].start()] + body + text[found[-1].end() :])


def control(case, dt, steps, viscosity, tolerance, relative, outer, correctors, pressure="GAMG", ranks=1):
    """Everything but mesh and fields: transient, laminar, central, backward in time."""
    write(case, "constant/transportProperties", "dictionary", f"transportModel Newtonian;\nnu [0 2 -1 0 0 0 0] {viscosity:.16g};")
    write(case, "constant/turbulenceProperties", "dictionary", "simulationType laminar;")
    write(case, "system/controlDict", "dictionary", f"""application pimpleFoam;
startFrom startTime; startTime 0; stopAt endTime; endTime {steps * dt:.16g}; deltaT {dt:.17g};
writeControl timeStep; writeInterval {steps}; writeFormat ascii; writePrecision 14; timePrecision 12;
writeCompression off; runTimeModifiable no;""")
    write(case, "system/fvSchemes", "dictionary", CENTRAL)
    solvers = {
        "GAMG": "solver GAMG; smoother DICGaussSeidel; nPreSweeps 0; nPostSweeps 2; cacheAgglomeration on; nCellsInCoarsestLevel 50;",
        "PCG": "solver PCG; preconditioner DIC;",
    }
    write(case, "system/fvSolution", "dictionary", f"""solvers {{
  p {{ {solvers[pressure]} tolerance {tolerance:g}; relTol {relative:g}; maxIter 2000; }}
  pFinal {{ $p; relTol 0; }}
  "(U|UFinal)" {{ solver smoothSolver; smoother symGaussSeidel; tolerance {tolerance:g}; relTol 0; }}
}}
PIMPLE {{ momentumPredictor yes; nOuterCorrectors {outer}; nCorrectors {correctors}; nNonOrthogonalCorrectors 0; pRefCell 0; pRefValue 0; }}""")
    write(case, "system/decomposeParDict", "dictionary",
          f"numberOfSubdomains {ranks};\nmethod simple;\nsimpleCoeffs {{ n ({ranks} 1 1); delta 0.001; }}")


def tool(case, *command):
    run = subprocess.run(command, cwd=case, env=environment(), capture_output=True, text=True)
    if run.returncode != 0:
        raise harness.Refused(f"{command[0]}: " + " ".join((run.stdout + run.stderr).split()[-30:]))


def solve(case, ranks=1, warm_up=5):
    """Runs pimpleFoam; wall and processor time a step after the warm-up [s], pressure iterations a step."""
    if ranks > 1:
        tool(case, "decomposePar")
    command = ["pimpleFoam"] if ranks == 1 else [
        "mpirun", *harness.MPI_FLAGS, "-n", str(ranks), "pimpleFoam", "-parallel"]
    wall, cpu, iterations = [], [], []
    with open(case / "log", "w") as log, subprocess.Popen(
        command, cwd=case, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as run:
        for line in run.stdout:
            log.write(line)
            if line.startswith("Time = "):
                iterations.append(0)
            elif "Solving for p," in line:
                iterations[-1] += int(line.rsplit("No Iterations", 1)[1])
            elif line.startswith("ExecutionTime = "):
                wall.append(time.perf_counter())
                cpu.append(float(line.split()[2]))
    if run.returncode != 0 or len(wall) < 2:
        raise harness.Refused(f"pimpleFoam failed, see {case / 'log'}")
    # The first step carries the start-up of the program.
    first = min(max(warm_up, 1), len(wall) - 1)
    count = len(wall) - first
    return {
        "steps": len(wall),
        "wall_per_step": (wall[-1] - wall[first - 1]) / count,
        "cpu_per_step": (cpu[-1] - cpu[first - 1]) / count,
        "cpu": cpu[-1],
        "poisson_iterations": sum(iterations[first:]) / count,
    }


def read_vectors(path):
    """Cell values of an ASCII vector field."""
    text = path.read_text()
    start = re.search(r"internalField\s+nonuniform\s+List<vector>\s*(\d+)\s*\(", text)
    body = text[start.end() : text.index(")\n;", start.end())]
    return np.fromstring(body.replace("(", " ").replace(")", " "), sep=" ").reshape(-1, 3)


def last_time(case):
    """Folder of the last field written."""
    times = [d for d in os.listdir(case) if re.fullmatch(r"[0-9.]+(e-?\d+)?", d) and d != "0"]
    return case / max(times, key=float)
