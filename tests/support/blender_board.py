"""Blender renders squares through a camera: python blender_board.py SHADER.osl SQUARES.npz PICTURE.

SQUARES.npz has ``corners`` (N, 4, 3) in the camera's frame, ``dark`` (N,), and ``size``, the
picture's.
"""

import hashlib
import sys
import types
from importlib import import_module
from pathlib import Path

import bpy
import numpy as np


def material(level: float) -> bpy.types.Material:
    made = bpy.data.materials.new("material")
    made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    light, out = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    light.inputs[0].default_value = (level, level, level, 1)
    made.node_tree.links.new(light.outputs[0], out.inputs[0])
    return made


def render(shader: str, squares: str, picture: str) -> None:
    given = np.load(squares)
    sys.modules["oslquery"] = types.ModuleType("oslquery")  # the wheel's add-on asks for it
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="cycles")
    mesh = bpy.data.meshes.new("squares")
    # Blender's cameras look along -z, and y is up.
    points = given["corners"].reshape(-1, 3) * [1, -1, -1]
    mesh.from_pydata(points.tolist(), [], np.arange(len(points)).reshape(-1, 4).tolist())
    mesh.materials.append(material(0.9))
    mesh.materials.append(material(0.05))
    for face, dark in zip(mesh.polygons, given["dark"], strict=True):
        face.material_index = int(dark)
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.custom_mode, camera.clip_end = "CUSTOM", "INTERNAL", 1e6
    assert import_module("_cycles").osl_compile(shader, f"{shader}.oso")
    code = Path(f"{shader}.oso").read_text()
    camera.custom_shader = bpy.data.texts.new("shader")
    camera.custom_bytecode = code
    camera.custom_bytecode_hash = hashlib.md5(code.encode()).hexdigest()
    camera.cycles_custom["unit"] = 1.0
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("camera", camera)
    for one in (scene.camera, bpy.data.objects.new("squares", mesh)):
        scene.collection.objects.link(one)
    scene.cycles.samples, scene.cycles.use_denoising = 64, False
    scene.cycles.use_adaptive_sampling = False
    scene.view_settings.view_transform = "Standard"
    how = scene.render
    how.engine, how.filepath, how.resolution_percentage = "CYCLES", picture, 100
    how.resolution_x, how.resolution_y = given["size"].tolist()
    how.image_settings.file_format, how.image_settings.color_mode = "PNG", "BW"
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    render(*sys.argv[1:])
