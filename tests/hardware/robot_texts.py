"""Small robot files for the tests: a URDF and an MJCF of the same two-joint arm, and what one may find of others."""

LINK = '<link name="{name}"><inertial><origin xyz="0 0 0.1"/><mass value="{mass}"/>{inertia}</inertial>{more}</link>'
INERTIA = '<inertia ixx="0.01" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/>'
JOINT = (
    '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="0 1 0"/>{limit}<dynamics damping="0.5" friction="0.1"/></joint>'
)
LIMIT = '<limit lower="-1.5" upper="1.5" effort="20" velocity="1"/>'
PICTURE = '<visual><geometry><mesh filename="package://nowhere/{name}.dae"/></geometry></visual>'


def link(name: str, mass: float = 1.0, inertia: str = INERTIA) -> str:
    return LINK.format(name=name, mass=mass, inertia=inertia, more=PICTURE.format(name=name))


def joint(name: str, parent: str, child: str, kind: str = "revolute", limit: str = LIMIT) -> str:
    return JOINT.format(name=name, parent=parent, child=child, kind=kind, limit=limit)


def robot(*parts: str) -> str:
    return f'<?xml version="1.0"?><robot name="r">{"".join(parts)}</robot>'


def arm(num_joints: int = 2, **changes) -> str:
    """A chain of links l0, l1, ... with joints j0, j1, ..."""
    links = [link(f"l{i}") for i in range(num_joints + 1)]
    return robot(*links, *(joint(f"j{i}", f"l{i}", f"l{i + 1}", **changes) for i in range(num_joints)))


MJCF = """
<mujoco model="r"><asset><mesh name="m" file="meshes/missing.stl"/></asset>
  <worldbody><body name="l0"><inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.02 0.03"/>
    <body name="l1" pos="0 0 0.3">
      <joint name="j0" axis="0 1 0" range="-1.5 1.5" limited="true" damping="0.5" frictionloss="0.1"/>
      <inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.02 0.03"/><geom type="mesh" mesh="m"/>
      <body name="l2" pos="0 0 0.3">
        <joint name="j1" axis="0 1 0" range="-1.5 1.5" limited="true" damping="0.5" frictionloss="0.1"/>
        <inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.02 0.03"/></body></body></body></worldbody>
  <compiler angle="radian"/><actuator><motor joint="j0" ctrlrange="-20 20" ctrllimited="true"/>
  <motor joint="j1" ctrlrange="-20 20" ctrllimited="true"/></actuator></mujoco>
"""
