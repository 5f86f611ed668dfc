"""Ray tracing with Mitsuba 3: which objects the camera's rays hit, the light they return, and shadows on the plane.

The Mitsuba scene is built once: two textured spheres, one triangle mesh for all other objects, the plane and the
environment. Each picture only refills its buffers. The buffers of the mesh have fixed sizes and are padded, because
Dr.Jit compiles again for a mesh of another size.

The module is long because all methods of its one class share these buffers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask, Singles
from vm_embedded.errors import InputError

from ..balls.texture import paint_texture
from ..scene.environment import Environment
from ..scene.scene import PlacedBall, Scene
from .mitsuba import load_mitsuba

_TEXTURE = 512  # rows of a ball's texture
_LIGHT = (1024, 512)  # columns and rows of the environment that lights a scene
_VERTICES, _TRIANGLES = 90_000, 60_000
_BATCH = 1 << 17  # largest number of rays that are traced together
_LIGHTS = 1 << 15  # entries of the table of lights for shadows
_SHADOW_RAYS = 48  # per point of the plane
_BOUNCED = 0.1  # share of light in a full shadow, reflected by objects around

NOTHING, BALL, OTHER = -1, -2, -3
"""What a ray hits if it is not a triangle; triangles have numbers from 0."""

Hits = npt.NDArray[np.int32]


@dataclass(frozen=True)
class Surfaces:
    """The first surfaces that n rays hit: what (n,), albedo (n, 3), normal (n, 3), and distance (n,) [m] or infinity.

    what: NOTHING, BALL, OTHER or the number of a triangle.
    """

    what: Hits
    albedo: Singles
    normal: Singles
    depth: Singles


class Tracer:
    """Traces one scene at a time; a process needs only one tracer."""

    def __init__(self) -> None:
        self._mi = mi = load_mitsuba()
        import drjit

        self._dr = drjit
        body = mi.Properties()
        body["bsdf"] = mi.load_dict(
            {
                "type": "principled",
                "base_color": {"type": "mesh_attribute", "name": "vertex_color"},
                "roughness": {"type": "mesh_attribute", "name": "vertex_roughness"},
                "specular": 0.4,
            }
        )
        bodies = mi.Mesh("bodies", _VERTICES, _TRIANGLES, has_vertex_normals=True, props=body)
        bodies.add_attribute("vertex_color", 3, np.zeros(3 * _VERTICES, np.float32))
        bodies.add_attribute("vertex_roughness", 1, np.ones(_VERTICES, np.float32))
        to_world = np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=float)
        light = np.ones((_LIGHT[1], _LIGHT[0], 3), np.float32)
        self._scene = mi.load_dict(
            {
                "type": "scene",
                "env": {"type": "envmap", "bitmap": mi.Bitmap(light), "to_world": mi.ScalarTransform4f(to_world)},
                "sun": {
                    "type": "directional",
                    "direction": [0.0, 0.0, -1.0],
                    "irradiance": {"type": "rgb", "value": 1.0},
                },
                "plane": {
                    "type": "rectangle",
                    "to_world": mi.ScalarTransform4f().scale(200.0),
                    "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.2, 0.2, 0.2]}},
                },
                "ball": _sphere(mi),
                "other": _sphere(mi),
                "bodies": bodies,
            }
        )
        self._parameters = mi.traverse(self._scene)
        shapes = [_to_numpy(drjit.reinterpret_array(mi.UInt32, mi.ShapePtr(each)))[0] for each in self._scene.shapes()]
        self._meanings = {
            int(number): {"ball": BALL, "other": OTHER, "plane": NOTHING}.get(each.id(), 0)
            for number, each in zip(shapes, self._scene.shapes(), strict=True)
        }
        self._integrator = mi.load_dict({"type": "path", "max_depth": 3, "rr_depth": 10})
        self._lit_by = ""

    def load_scene(self, scene: Scene, environment: Environment) -> None:
        """Fill the buffers with a scene. Raises InputError if it has too many triangles or vertices."""
        p, mi = self._parameters, self._mi
        for name, ball in (("ball", scene.ball), ("other", scene.other)):
            self._set_ball(name, ball)
        mesh = scene.mesh
        if len(mesh.vertices) > _VERTICES or len(mesh.triangles) > _TRIANGLES:
            raise InputError(
                f"a scene has {len(mesh.triangles)} triangles and {len(mesh.vertices)} vertices; the limits are "
                f"{_TRIANGLES} and {_VERTICES}: lower the numbers in section [things]"
            )
        p["bodies.vertex_positions"] = self._float(_padded(mesh.vertices, _VERTICES))
        p["bodies.vertex_normals"] = self._float(_padded(mesh.normals, _VERTICES))
        p["bodies.vertex_color"] = self._float(_padded(mesh.colors, _VERTICES))
        p["bodies.vertex_roughness"] = self._float(_padded(mesh.roughness, _VERTICES, 1.0))
        p["bodies.faces"] = mi.UInt32(_padded(mesh.triangles.astype(np.uint32), _TRIANGLES).ravel())
        p["plane.bsdf.reflectance.value"] = mi.Color3f(*(self._opaque(each) for each in scene.ground_albedo))
        if self._lit_by != environment.name:
            self._lit_by = environment.name
            light = environment.lighting(_LIGHT)
            sky = np.concatenate([light.sky[:, -1:], light.sky, light.sky[:, :1]], axis=1)
            p["env.data"] = mi.TensorXf(self._float(sky), sky.shape)
            p["sun.irradiance.value"] = mi.Color3f(*(self._opaque(float(each)) for each in light.sun))
            p["sun.to_world"] = self._transform(_rotation_to(-light.toward_sun))
            self._set_lights(environment)
        p.update()

    def _set_ball(self, name: str, ball: PlacedBall | None) -> None:
        p, mi = self._parameters, self._mi
        matrix = np.diag([1e-3, 1e-3, 1e-3, 1.0])
        matrix[2, 3] = -100.0
        if ball is not None:
            matrix[:3, :3] = ball.radius * ball.attitude
            matrix[:3, 3] = ball.center
            texture = paint_texture(ball.design, _TEXTURE)
            p[f"{name}.bsdf.base_color.data"] = mi.TensorXf(self._float(texture), texture.shape)
            p[f"{name}.bsdf.roughness.value"] = self._opaque(ball.design.roughness)
            p[f"{name}.bsdf.specular"] = self._opaque(ball.design.specular)
            p[f"{name}.bsdf.clearcoat.value"] = self._opaque(ball.design.clearcoat)
        p[f"{name}.to_world"] = self._transform(matrix)

    def _set_lights(self, environment: Environment) -> None:
        """Fill the table of lights; each occurs in proportion to its irradiance on the plane."""
        directions, irradiance = environment.lights
        weight = irradiance.sum(axis=1, dtype=np.float64)
        edges = np.cumsum(weight) / weight.sum()
        chosen = np.minimum(np.searchsorted(edges, (np.arange(_LIGHTS) + 0.5) / _LIGHTS), len(weight) - 1)
        self._light_directions = self._float(directions[chosen])
        self._light_colors = self._float(irradiance[chosen] / weight[chosen, None])

    def first_hits(self, origin: Floats, rays: Singles) -> Hits:
        """What each ray (n, 3) from the origin (3,) hits first (n,): NOTHING, BALL, OTHER or a triangle's number."""
        found = np.empty(len(rays), dtype=np.int32)
        for part in _batches(len(rays)):
            ray = self._ray(origin, rays[part])
            hit = self._scene.ray_intersect_preliminary(ray, coherent=True)
            found[part] = _to_numpy(self._what(hit.shape, hit.prim_index))
        return found

    def trace_light(self, origin: Floats, rays: Singles, wanted: Mask, per_pixel: int, seed: int) -> Singles:
        """Radiance (n, 3) that returns along rays (n, 3) from the origin (3,), one path per ray.

        wanted: which rays (n,) to trace; others return 0. per_pixel: number of successive rays of the same pixel, a
        power of 4. Their paths are spread evenly.
        """
        mi = self._mi
        evenly = mi.load_dict({"type": "ldsampler", "sample_count": per_pixel})
        evenly.set_samples_per_wavefront(per_pixel)
        found = np.empty((len(rays), 3), dtype=np.float32)
        for number, part in enumerate(_batches(len(rays))):
            sampler = evenly.clone()
            sampler.seed(self._dr.opaque(mi.UInt32, (seed + 7919 * number) & 0xFFFFFFFF), part.stop - part.start)
            ray = mi.RayDifferential3f(self._ray(origin, rays[part]))
            light, _, _ = self._integrator.sample(self._scene, sampler, ray, None, self._float(wanted[part]) > 0.0)
            found[part] = _to_numpy(self._dr.ravel(light)).reshape(-1, 3)
        return np.nan_to_num(found, copy=False, posinf=0.0, neginf=0.0)

    def first_surfaces(self, origin: Floats, rays: Singles) -> Surfaces:
        """The first surfaces that rays (n, 3) from the origin (3,) hit."""
        mi, dr = self._mi, self._dr
        what = np.empty(len(rays), np.int32)
        albedo, normal = np.empty((len(rays), 3), np.float32), np.empty((len(rays), 3), np.float32)
        depth = np.empty(len(rays), np.float32)
        for part in _batches(len(rays)):
            ray = mi.RayDifferential3f(self._ray(origin, rays[part]))
            met = self._scene.ray_intersect(ray)
            color = met.bsdf(ray).eval_diffuse_reflectance(met, met.is_valid())
            hit = self._what(met.shape, met.prim_index)
            dr.eval(hit, color, met.sh_frame.n, met.t)
            what[part] = _to_numpy(hit)
            albedo[part] = _to_numpy(dr.ravel(color)).reshape(-1, 3)
            normal[part] = _to_numpy(dr.ravel(met.sh_frame.n)).reshape(-1, 3)
            depth[part] = _to_numpy(met.t)
        return Surfaces(what, albedo, normal, depth)

    def unblocked_light(self, points: Floats, random: np.random.Generator) -> Singles:
        """Share (n, 3) of the environment's light that reaches points (n, 2) [m] of the plane past all objects."""
        result = np.empty((len(points), 3), dtype=np.float32)
        for part in _batches(len(points)):
            places = self._mi.Point3f(*(self._float(column) for column in points[part].T), self._opaque(1e-3))
            sums = self._sum_lights(places, self._float(random.random(part.stop - part.start, dtype=np.float32)))
            lit, full = (_to_numpy(self._dr.ravel(each)).reshape(-1, 3) for each in sums)
            result[part] = lit / np.maximum(full, 1e-9)
        return _BOUNCED + (1.0 - _BOUNCED) * result

    def _sum_lights(self, places: Any, shift: Any) -> tuple[Any, Any]:
        """Sums (n, 3) of the lights that n places see, and of all lights that they look for.

        shift: place of each ray within its stratum of the table of lights (n,), 0 to 1.
        """
        mi, dr = self._mi, self._dr
        rounds = self._opaque(_SHADOW_RAYS)  # Dr.Jit would multiply by the rounded reciprocal of a constant

        def add_ray(number: Any, lit: Any, full: Any) -> tuple[Any, Any, Any]:
            stratum = (mi.Float(number) + shift) / rounds
            chosen = dr.minimum(mi.UInt32(stratum * _LIGHTS), _LIGHTS - 1)
            color = dr.gather(mi.Color3f, self._light_colors, chosen)
            blocked = self._scene.ray_test(mi.Ray3f(places, dr.gather(mi.Vector3f, self._light_directions, chosen)))
            return number + 1, lit + dr.select(blocked, 0.0, color), full + color

        start = mi.UInt32(0), dr.zeros(mi.Color3f), dr.zeros(mi.Color3f)
        _, lit, full = dr.while_loop(start, lambda number, lit, full: number < _SHADOW_RAYS, add_ray)
        dr.eval(lit, full)
        return lit, full

    def _what(self, shape: Any, triangle: Any) -> Any:
        """What rays hit (n,), as in first_hits, from the shapes and the numbers of their triangles."""
        mi, dr = self._mi, self._dr
        number, what = dr.reinterpret_array(mi.UInt32, shape), mi.Int32(NOTHING)
        for each, meaning in self._meanings.items():
            what = dr.select(number == each, mi.Int32(triangle) if meaning == 0 else meaning, what)
        return what

    def _ray(self, origin: Floats, rays: Singles) -> Any:
        mi = self._mi
        place = mi.Point3f(*(self._opaque(float(each)) for each in origin))
        return mi.Ray3f(place, mi.Vector3f(*(self._float(column) for column in rays.T)))

    def _float(self, array: npt.NDArray[Any]) -> Any:
        """A copy in Dr.Jit's own memory: NumPy's may have another alignment, for which Dr.Jit compiles again."""
        buffer = self._mi.Float(np.ascontiguousarray(array, dtype=np.float32).ravel()) + self._opaque(0.0)
        self._dr.eval(buffer)
        return buffer

    def _transform(self, matrix: Floats) -> Any:
        transform = self._mi.AffineTransform4f(self._mi.ScalarTransform4f(matrix))
        self._dr.make_opaque(transform)
        return transform

    def _opaque(self, value: float) -> Any:
        return self._dr.opaque(self._mi.Float, value)


def _sphere(mi: Any) -> dict[str, Any]:
    texture = mi.Bitmap(np.full((_TEXTURE, 2 * _TEXTURE, 3), 0.5, np.float32))
    return {
        "type": "sphere",
        "bsdf": {
            "type": "principled",
            "base_color": {"type": "bitmap", "bitmap": texture, "raw": True},
            "roughness": 0.5,
            "specular": 0.5,
            "clearcoat": 0.1,
        },
    }


def _to_numpy(array: Any) -> npt.NDArray[Any]:
    return np.asarray(array.numpy())


def _rotation_to(direction: Floats) -> Floats:
    """A transform (4, 4) that rotates z to a direction (3,)."""
    side = np.cross([1.0, 0.0, 0.0] if abs(direction[0]) < 0.9 else [0.0, 1.0, 0.0], direction)
    side /= np.linalg.norm(side)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([side, np.cross(direction, side), direction])
    return matrix


def _padded(array: npt.NDArray[Any], count: int, value: float = 0.0) -> npt.NDArray[Any]:
    """The array (n, ...) with `value` in further rows up to `count`."""
    padded = np.full((count, *array.shape[1:]), value, dtype=array.dtype)
    padded[: len(array)] = array
    return padded


def _batches(count: int) -> list[slice]:
    return [slice(start, min(start + _BATCH, count)) for start in range(0, count, _BATCH)]
