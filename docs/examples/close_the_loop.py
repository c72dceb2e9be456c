"""Moves an exported reacher policy's arm to a goal, in plain MuJoCo: pip install mujoco onnxruntime

python close_the_loop.py FOLDER [--goal X Y Z] [--start POSE], where FOLDER is what `python -m hcp_jax.export` wrote.
"""

import argparse
import json
import pathlib

import mujoco
import numpy as np
import onnxruntime

parser = argparse.ArgumentParser()
parser.add_argument("folder", type=pathlib.Path)
parser.add_argument("--goal", type=float, nargs=3, help="of the end effector, in m; by default the middle of the goals' box")
parser.add_argument("--start", type=int, default=0, help="which of the poses that training started from")
options = parser.parse_args()

if not (options.folder / "policy.json").exists():
    parser.error(f"{options.folder}: not a folder that hcp_jax.export wrote")
policy = json.loads((options.folder / "policy.json").read_text())
if policy["task"] != "reacher":
    parser.error(f"{options.folder}: a policy of {policy['task']}: expected one of the reacher")
if not 0 <= options.start < len(policy["start_angles"]):
    parser.error(f"--start={options.start}: expected 0 to {len(policy['start_angles']) - 1}")
session = onnxruntime.InferenceSession(options.folder / "policy.onnx", providers=["CPUExecutionProvider"])
model = mujoco.MjModel.from_xml_path(str(options.folder / "robot.xml"))
data = mujoco.MjData(model)
data.qpos[:] = policy["start_angles"][options.start]
goal = np.array(options.goal or np.mean([policy["goal"]["low"], policy["goal"]["high"]], axis=0))
substeps = round(policy["control_period"] / model.opt.timestep)

steps, distance, within = 0, np.inf, policy["goal"]["success_distance"]
while distance >= within and steps < policy["episode_length"]:
    observation = np.concatenate([data.qpos, data.qvel, goal]).astype(np.float32)
    (data.ctrl[:],) = session.run(None, {"observation": observation})
    mujoco.mj_step(model, data, nstep=substeps)
    mujoco.mj_kinematics(model, data)
    distance = float(np.linalg.norm(data.site(policy["goal"]["site"]).xpos - goal))
    steps += 1
print(json.dumps({"reached": distance < within, "steps": steps, "distance": distance}))
