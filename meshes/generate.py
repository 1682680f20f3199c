"""Writes the meshes of this folder, from their .geo files: python generate.py (needs `pip install gmsh meshio vtk`).

`python generate.py vtk` and `python generate.py foam` convert the .msh files only; the latter needs OpenFOAM.
"""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).parent


def write(name, binary):
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", int(binary))
    gmsh.write(str(HERE / name))


def generate(name, binary=True):
    gmsh.clear()
    gmsh.open(str(HERE / f"{name}.geo"))
    gmsh.model.mesh.generate(3)
    write(f"{name}.msh", False)
    if binary:
        write(f"{name}_binary.msh", True)


def invert_one_element():
    """A copy of periodic.msh in which the fifth tetrahedron has two vertices exchanged."""
    lines = (HERE / "periodic.msh").read_text().splitlines()
    elements = lines.index("$Elements")
    block = next(k for k in range(elements, len(lines)) if lines[k].startswith("3 1 4 "))
    tag, a, b, c, d = lines[block + 5].split()
    lines[block + 5] = f"{tag} {b} {a} {c} {d}"
    (HERE / "inverted.msh").write_text("\n".join(lines) + "\n")


def as_vtk():
    """mixed.msh as meshio and VTK itself write it."""
    import meshio
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

    mesh = meshio.gmsh.read(HERE / "mixed.msh")
    mesh.cell_data = {"gmsh:physical": mesh.cell_data["gmsh:physical"]}
    mesh.cell_sets, mesh.point_data = {}, {}
    compressed = HERE / "mixed_zlib.vtu"
    meshio.vtu.write(compressed, mesh, binary=True, compression="zlib")
    meshio.vtu.write(HERE / "mixed_text.vtu", mesh, binary=False)
    meshio.vtk.write(HERE / "mixed_42.vtk", mesh, fmt_version="4.2", binary=False)
    meshio.vtk.write(HERE / "mixed_51.vtk", mesh, fmt_version="5.1", binary=True)
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(compressed))
    reader.Update()
    for name, encode, order in (("raw", False, "LittleEndian"), ("base64", True, "BigEndian")):
        writer = vtkXMLUnstructuredGridWriter()
        writer.SetFileName(str(HERE / f"mixed_appended_{name}.vtu"))
        writer.SetInputData(reader.GetOutput())
        writer.SetDataModeToAppended()
        writer.SetEncodeAppendedData(encode)
        getattr(writer, f"SetByteOrderTo{order}")()
        if not encode:
            writer.SetCompressorTypeToNone()
            writer.SetHeaderTypeToUInt64()
        writer.Write()


HEADER = "FoamFile {{ version 2.0; format ascii; class dictionary; object {0}; }}\n"
CONTROL = """application x; startFrom startTime; startTime 0; stopAt endTime; endTime 1; deltaT 1;
writeControl timeStep; writeInterval 1; writePrecision 12;
"""
BLOCK = """convertToMeters 1;
vertices ((0 0 0) (2 0 0) (2 1 0) (0 1 0) (0 0 0.5) (2 0 0.5) (2 1 0.5) (0 1 0.5));
blocks (hex (0 1 2 3 4 5 6 7) (4 3 2) simpleGrading (1 3 1));
boundary (
    left { type cyclic; neighbourPatch right; faces ((0 4 7 3)); }
    right { type cyclic; neighbourPatch left; faces ((1 2 6 5)); }
    walls { type wall; faces ((0 1 5 4) (3 7 6 2)); }
    frontAndBack { type empty; faces ((0 3 2 1) (4 5 6 7)); }
);
"""


def as_foam():
    """mixed.msh and a periodic box as OpenFOAM writes them, in text and binary (needs its programs)."""
    import meshio

    for name in ("mixed", "box"):
        with tempfile.TemporaryDirectory() as folder:
            case = pathlib.Path(folder)
            (case / "system").mkdir()
            control = HEADER.format("controlDict") + CONTROL
            (case / "system/controlDict").write_text(control + "writeFormat ascii;\n")
            for file in ("fvSchemes", "fvSolution"):
                (case / "system" / file).write_text(HEADER.format(file))

            def run(*command):
                environment = {"WM_PROJECT_DIR": "/usr/share/openfoam"} | os.environ
                subprocess.run(command, cwd=case, env=environment, check=True, stdout=subprocess.DEVNULL)

            if name == "mixed":
                mesh = meshio.gmsh.read(HERE / "mixed.msh")
                meshio.gmsh.write(case / "mixed.msh", mesh, fmt_version="2.2", binary=False)
                run("gmshToFoam", "mixed.msh")
            else:
                (case / "system/blockMeshDict").write_text(HEADER.format("blockMeshDict") + BLOCK)
                run("blockMesh")
            for form in ("text", "binary"):
                if form == "binary":
                    (case / "system/controlDict").write_text(control + "writeFormat binary;\n")
                    run("foamFormatConvert", "-constant")
                target = HERE / f"{name}_{form}.polyMesh"
                target.mkdir(exist_ok=True)
                for file in ("points", "faces", "owner", "neighbour", "boundary"):
                    shutil.copy(case / "constant/polyMesh" / file, target / file)


def from_geo():
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    generate("mixed")
    generate("periodic")
    generate("slab", binary=False)
    invert_one_element()
    gmsh.finalize()


if not sys.argv[1:]:
    import gmsh

    from_geo()
if sys.argv[1:] != ["foam"]:
    as_vtk()
if sys.argv[1:] != ["vtk"]:
    as_foam()
