"""The question: scene files, their checks, the scenes that come with the package, and the result that answers one.

Said once for the whole package: SI units, radians inside and degrees in files where a key says ``_deg``; right-handed,
y up, camera right = forward x up; row 0 of an array is the top row and texel centres lie at +1/2; scattering cosine 1
is forward and phase functions integrate to 1 over the sphere.
"""

from atmoref.scene.camera import Camera, pixel_to_camera_plane, ray_directions
from atmoref.scene.document import Scene, scene_from_mapping
from atmoref.scene.errors import SceneError, parse_model
from atmoref.scene.load import bundled_names, bundled_text, load_scene, parse_scene
from atmoref.scene.models import Box, Buffers, Ground, Image, Medium, PhaseFunction, Sphere, Spot, Technique
from atmoref.scene.result import Result

__all__ = [
    "Box",
    "Buffers",
    "Camera",
    "Ground",
    "Image",
    "Medium",
    "PhaseFunction",
    "Result",
    "Scene",
    "SceneError",
    "Sphere",
    "Spot",
    "Technique",
    "bundled_names",
    "bundled_text",
    "load_scene",
    "parse_model",
    "parse_scene",
    "pixel_to_camera_plane",
    "ray_directions",
    "scene_from_mapping",
]
