"""A path tracer for Mitsuba 3 that tells of every path what a denoiser may be told: Mitsuba's own `path`, with more outputs.

The **reflection features** are of the first surface that scatters the path diffusely: a path that a mirror, or the glossy part of a surface, sends on is
followed, as its BSDF was sampled, and what it hits next counts. A diffuse surface has its own.

Caustics are left out unless asked for, as most renderers of films do: once a path was scattered diffusely, lamps that it runs into by way of a mirror or a
glossy surface are not counted.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

FOLLOWED = 0.5
"""Roughness up to which a glossy reflection is followed; rougher ones show nothing in particular."""
FAR = 0.0
"""Depth where a path hits nothing, and every other feature there."""
CHANNELS = (
    *"RGB",
    *(f"albedo.{c}" for c in "RGB"),
    *(f"N.{c}" for c in "XYZ"),
    "Z",
    *(f"P.{c}" for c in "XYZ"),
    *(f"reflAlbedo.{c}" for c in "RGB"),
    *(f"reflN.{c}" for c in "XYZ"),
    "roughness",
    "shadow",
)
"""What a path tells, in this order: colour, albedo 0 to 1, shading normal in the world, distance along the ray from the near plane, position in the world,
the reflection features (what is left of the path's light after its first diffuse scattering: the albedo that is seen, in a mirror's tint; the normal there),
the roughness of the first hit (0 of a mirror, 1 of what is diffuse), and whether it sees the point of a light that was chosen (its mean is the share of the
light that is seen)."""


def trace(scene: Any, seed: int, samples: int, depth: int, caustics: bool = False) -> np.ndarray:
    """`samples` independent paths through random points of each pixel: (height x width, samples, channels), float32."""
    sensor = scene.sensors()[0]
    width, height = (int(side) for side in sensor.film().size())
    lane = dr.arange(mi.UInt32, width * height * samples)
    pixel = lane // samples
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, width * height * samples)
    where = mi.Point2f(mi.Float(pixel % width), mi.Float(pixel // width)) + sampler.next_2d()
    with dr.suspend_grad():
        ray, _ = sensor.sample_ray(0.0, sampler.next_1d(), where / mi.Vector2f(width, height), mi.Point2f(0.5))
        found = _path(scene, sampler, mi.Ray3f(ray), depth, caustics)
        dr.eval(found)
    return np.stack([np.array(channel) for channel in found], -1).reshape(width * height, samples, len(CHANNELS))


def _albedo(si: Any, bsdf: Any, active: Any) -> Any:
    """0 to 1; 1 of a lamp."""
    own = dr.clip(bsdf.eval_diffuse_reflectance(si, active), 0, 1)
    return dr.select(si.shape.is_emitter(), mi.Spectrum(1), own)


def _roughness(si: Any, bsdf: Any, active: Any) -> Any:
    known = bsdf.has_attribute("roughness", active)
    smooth = mi.has_flag(bsdf.flags(), mi.BSDFFlags.Delta)
    return dr.select(known, bsdf.eval_attribute_1("roughness", si, active & known), dr.select(smooth, mi.Float(0), mi.Float(1)))


def _balance(own: Any, other: Any) -> Any:
    """The power heuristic's weight of a sample that was taken with the density `own`."""
    return dr.select(own > 0, own * own / (own * own + other * other), 0)


@dr.syntax
def _path(scene: Any, sampler: Any, ray: Any, most: int, caustics: bool) -> list[Any]:
    """The channels of one path per lane."""
    context = mi.BSDFContext()
    colour, throughput, depth = mi.Spectrum(0), mi.Spectrum(1), mi.UInt32(0)
    before, before_pdf, before_smooth = dr.zeros(mi.SurfaceInteraction3f), mi.Float(1), mi.Bool(True)
    active, following, counted = mi.Bool(True), mi.Bool(True), mi.Bool(True)
    albedo, normal, position = mi.Spectrum(0), mi.Normal3f(0), mi.Point3f(0)
    reflected_albedo, reflected_normal = mi.Spectrum(0), mi.Normal3f(0)
    distance, roughness, seen = mi.Float(FAR), mi.Float(0), mi.Float(0)

    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=depth == 0, active=active)
        bsdf, hit, first = si.bsdf(), active & si.is_valid(), depth == 0

        # light that the path runs into, weighted against the chance of having aimed at it
        light = mi.DirectionSample3f(scene, si, before)
        aimed_pdf = scene.pdf_emitter_direction(before, light, ~before_smooth)
        colour += dr.select(counted, throughput * _balance(before_pdf, aimed_pdf) * light.emitter.eval(si, active), 0)

        # light that is aimed at; that a lamp is seen is asked at a mirror too
        going_on = hit & (depth + 1 < most)
        aimed, emitted = scene.sample_emitter_direction(si, sampler.next_2d(), True, going_on)
        wo = si.to_local(aimed.d)
        value, pdf = bsdf.eval_pdf(context, si, wo, going_on)
        colour += dr.select(going_on & (aimed.pdf > 0), throughput * value * emitted * _balance(aimed.pdf, pdf), 0)

        # where the path goes
        sampled, weight = bsdf.sample(context, si, sampler.next_1d(), sampler.next_2d(), going_on)
        smooth = mi.has_flag(sampled.sampled_type, mi.BSDFFlags.Delta)
        here_roughness = _roughness(si, bsdf, hit & following)
        sent_on = smooth | mi.has_flag(sampled.sampled_type, mi.BSDFFlags.Glossy) & (here_roughness <= FOLLOWED)

        # what the path tells
        facing = dr.select(dr.dot(si.sh_frame.n, ray.d) > 0, -si.sh_frame.n, si.sh_frame.n)
        lamp = si.shape.is_emitter()
        lit = (aimed.pdf > 0) & (dr.max(emitted) > 0) & (wo.z > 0)
        albedo = dr.select(first & hit, _albedo(si, bsdf, first & hit), albedo)
        normal = dr.select(first & hit, facing, normal)
        position = dr.select(first & hit, si.p, position)
        distance = dr.select(first & hit, si.t, distance)
        roughness = dr.select(first & hit, here_roughness, roughness)
        seen = dr.select(first & hit & lit, 1, seen)
        reflected_albedo = dr.select(following & hit, throughput * dr.select(lamp, mi.Spectrum(1), weight), reflected_albedo)
        reflected_normal = dr.select(following & hit, facing, reflected_normal)

        counted = mi.Bool(caustics) | following | ~sent_on
        following &= hit & sent_on & ~lamp
        throughput *= weight
        ray = si.spawn_ray(si.to_world(sampled.wo))
        before, before_pdf, before_smooth = si, sampled.pdf, smooth
        depth += 1
        # no Russian roulette: here it brings more noise than it saves time
        active = going_on & (dr.max(throughput) > 0)

    return [*colour, *albedo, *normal, distance, *position, *reflected_albedo, *reflected_normal, roughness, seen]
