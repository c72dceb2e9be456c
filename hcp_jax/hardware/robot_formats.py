"""URDF and MJCF files as MuJoCo specs of bodies, joints and inertias, without pictures."""

import itertools
import math
import pathlib
import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np

from hcp_jax.errors import one_line
from hcp_jax.hardware.robot_xml import RobotFileError, check_references, parse_xml

MAX_ROUNDING = 0.01  # share of a link's largest moment of inertia that digits left out may have made too much of it


def load_robot_spec(path: pathlib.Path, notes: list[str]) -> tuple[mujoco.MjSpec, dict[str, str]]:
    """Reads a URDF or MJCF file.

    Args:
        path: the file.
        notes: gets a line for what is left out.

    Returns:
        bodies, joints and inertias, all of them named; and of each joint that another one moves, that one's name.

    Raises:
        RobotFileError: the file is neither, or refers to files outside its folder.
    """
    root = parse_xml(path)
    if root.tag == "robot":
        mimics = {
            joint.get("name", ""): mimic.get("joint", "") for joint in root.iter("joint") for mimic in joint.iter("mimic")
        }
        spec = load_urdf(root)
        relax_inertias(spec, notes)
        return spec, mimics
    if root.tag != "mujoco":
        raise RobotFileError(f"starts with <{root.tag}>: expected <robot> (URDF) or <mujoco> (MJCF)")
    spec = load_mjcf(path, root, notes)
    relax_inertias(spec, notes)
    constraints = [equality for equality in spec.equalities if equality.active and equality.type == mujoco.mjtEq.mjEQ_JOINT]
    return spec, {constraint.name1: constraint.name2 or "a constant" for constraint in constraints}


def load_urdf(root: ElementTree.Element) -> mujoco.MjSpec:
    """Links, joints and inertias of a URDF; MuJoCo reads them."""
    for child in list(root):
        if child.tag not in ("link", "joint"):
            root.remove(child)
    for link in root.iter("link"):
        for picture in [child for child in link if child.tag != "inertial"]:
            link.remove(picture)
    for joint in root.iter("joint"):
        name, limit = joint.get("name"), joint.find("limit")
        if joint.get("type") == "continuous" and limit is not None:
            for side in ("lower", "upper"):
                limit.attrib.pop(side, None)
        if joint.get("type") == "revolute":
            check_limits(name or "", limit)
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(extension, "compiler", {"fusestatic": "false", "discardvisual": "false"})
    return load_spec(ElementTree.tostring(root, encoding="unicode"))


def check_limits(joint: str, limit: ElementTree.Element | None) -> None:
    """Raises RobotFileError unless a revolute joint has a lower limit below an upper one; MuJoCo takes others for none."""
    low, high = ("0" if limit is None else limit.get(side, "0") for side in ("lower", "upper"))
    try:
        is_range = -math.inf < float(low) < float(high) < math.inf
    except ValueError:
        is_range = False
    if not is_range:
        raise RobotFileError(
            f"joint {joint}: revolute with limits {low} to {high}: expected a lower and a larger upper one, or continuous"
        )


def load_spec(text: str) -> mujoco.MjSpec:
    try:
        return mujoco.MjSpec.from_string(text)
    except (ValueError, mujoco.FatalError) as error:
        raise RobotFileError(one_line(error)) from error


def load_mjcf(path: pathlib.Path, root: ElementTree.Element, notes: list[str]) -> mujoco.MjSpec:
    """An MJCF file and what it includes, without geoms of meshes that are missing and without pictures."""
    check_references(path, root)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise RobotFileError(one_line(error)) from error
    name_all(spec)
    spec.compiler.fusestatic = False  # links are asked for by name
    folder = path.parent / (spec.meshdir or "")
    missing = {mesh.name for mesh in spec.meshes if mesh.file and not (folder / mesh.file).exists()}
    if missing:
        notes.append(f"meshes that are missing: {', '.join(sorted(missing))}")
    note_missing_masses(spec, missing, notes)
    for body in spec.bodies:
        is_weighed = weighs_geoms(spec, body)
        for geom in list(body.geoms):
            if not is_weighed or geom.meshname in missing or geom.type == mujoco.mjtGeom.mjGEOM_HFIELD:
                spec.delete(geom)
            else:
                geom.material = ""
        for site in body.sites:
            site.material = ""
    for mesh in list(spec.meshes):
        if mesh.name in missing or not any(geom.meshname == mesh.name for geom in spec.geoms):
            spec.delete(mesh)
    for picture in [*spec.materials, *spec.textures, *spec.hfields]:
        spec.delete(picture)
    return spec


def name_all(spec: mujoco.MjSpec) -> None:
    """Names bodies that have no name, as MJCF allows, by number; and joints after their body."""
    bodies, joints = {body.name for body in spec.bodies}, {joint.name for joint in spec.joints}
    for body in spec.bodies[1:]:
        body.name = body.name or next(name for i in itertools.count(1) if (name := f"body{i}") not in bodies)
        bodies.add(body.name)
        for joint in body.joints:
            endings = itertools.chain([""], (f"_{i}" for i in itertools.count(2)))
            joint.name = joint.name or next(name for ending in endings if (name := body.name + ending) not in joints)
            joints.add(joint.name)


def weighs_geoms(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> bool:
    """Whether a link's mass and inertia are those of its geoms, and not the ones stated."""
    rules = mujoco.mjtInertiaFromGeom
    rule = spec.compiler.inertiafromgeom
    return rule == rules.mjINERTIAFROMGEOM_TRUE or (rule == rules.mjINERTIAFROMGEOM_AUTO and not body.explicitinertial)


def note_missing_masses(spec: mujoco.MjSpec, missing: set[str], notes: list[str]) -> None:
    """Says of which links a part of the mass is missing, with the meshes of that part."""
    low, high = spec.compiler.inertiagrouprange
    for body in spec.bodies[1:]:
        parts = [geom for geom in body.geoms if geom.meshname in missing and low <= geom.group <= high]
        # Where a geom's mass is not stated it is not a number, and its density counts.
        lost = sorted({part.meshname for part in parts if part.mass != 0 and (part.mass > 0 or part.density != 0)})
        if lost and weighs_geoms(spec, body):
            notes.append(f"mass of link {body.name} without its missing meshes: {', '.join(lost)}")


def relax_inertias(spec: mujoco.MjSpec, notes: list[str]) -> None:
    """Lowers the largest moment of inertia of links where it is above the sum of the others by no more than rounding does.

    No body has such moments, and MuJoCo refuses them. A flat link's are at that limit, and the digits of a file, or of turning
    its axes, leave them on either side of it. What is left below it is more than later sums and factors round by.
    """
    for body in spec.bodies[1:]:
        if not body.explicitinertial:
            continue
        is_full = bool(np.isfinite(body.fullinertia[0]))
        if is_full:
            xx, yy, zz, xy, xz, yz = body.fullinertia
            moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            moments, axes = np.array(body.inertia), np.eye(3)
        largest = int(np.argmax(moments))
        others = float(moments.sum() - moments[largest])
        excess = float(moments[largest] - others)
        if not -1e-12 * others < excess <= MAX_ROUNDING * moments[largest]:
            continue
        if excess > 1e-6 * others:
            share = 100.0 * excess / float(moments[largest])
            notes.append(
                f"inertia of link {body.name} lowered by {share:.2g} %: it was above what a body can have (A + B >= C)"
            )
        moments[largest] = others * (1.0 - 1e-9)
        if is_full:
            tensor = axes @ np.diag(moments) @ axes.T
            body.fullinertia = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        else:
            body.inertia = moments
