"""Writes the Gmsh meshes of this folder from their .geo files: python generate.py (needs `pip install gmsh`)."""

import pathlib

import gmsh

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


gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
generate("mixed")
generate("periodic")
generate("slab", binary=False)
invert_one_element()
gmsh.finalize()
