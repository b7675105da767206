"""The question: scene files, their checks, the scenes that come with the package, and the result that answers one.

Said once for the whole package: SI units, radians inside and degrees in files where a key says ``_deg``; right-handed,
y up, camera right = forward x up; row 0 of an array is the top row and texel centres lie at +1/2; scattering cosine 1
is forward and phase functions integrate to 1 over the sphere.
"""

from atmoref.scene.camera import Camera, pixel_to_camera_plane, ray_directions
from atmoref.scene.document import Scene, scene_from_mapping
from atmoref.scene.errors import SceneError, parse_model
from atmoref.scene.lights import Light, Projector, Spot, Sun, Window
from atmoref.scene.load import bundled_names, bundled_text, load_scene, parse_scene
from atmoref.scene.models import Buffers, Image, Medium, PhaseFunction, Technique
from atmoref.scene.objects import Box, Ground, HeightField, Mesh, Object, Sphere
from atmoref.scene.result import Result
from atmoref.scene.triangles import Triangles

__all__ = [
    "Box",
    "Buffers",
    "Camera",
    "Ground",
    "HeightField",
    "Image",
    "Light",
    "Medium",
    "Mesh",
    "Object",
    "PhaseFunction",
    "Projector",
    "Result",
    "Scene",
    "SceneError",
    "Sphere",
    "Spot",
    "Sun",
    "Technique",
    "Triangles",
    "Window",
    "bundled_names",
    "bundled_text",
    "load_scene",
    "parse_model",
    "parse_scene",
    "pixel_to_camera_plane",
    "ray_directions",
    "scene_from_mapping",
]
