"""A lock of hair in Mitsuba, lit through itself: python examples/render_hair.py [OUTPUT.png] [SAMPLES]."""

import sys

import mitsuba as mi

import cuticle.mitsuba  # noqa: F401 - registers `cuticle` and `dual_scattering`
from cuticle.grooms.procedural import wavy_lock
from cuticle.render.picture import render, save_picture

mi.set_variant("scalar_rgb")  # or llvm_ad_rgb, cuda_ad_rgb, and their spectral sisters

output = sys.argv[1] if len(sys.argv) > 1 else "lock.png"
samples = int(sys.argv[2]) if len(sys.argv) > 2 else 64

groom = wavy_lock(3000)  # or read_groom("head.hair").with_thickness(0.04, 0.015)
groom.save("lock.txt")  # Mitsuba's bsplinecurve, through the groom's points
scene = mi.load_dict(
    {
        "type": "scene",
        "integrator": {"type": "dual_scattering", "hide_emitters": True},  # or {"type": "path", "max_depth": 64}
        "hair": {
            "type": "bsplinecurve",
            "filename": "lock.txt",
            "bsdf": {"type": "cuticle", "fibre": "blond", "scale": 0.8},
        },
        "room": {"type": "constant", "radiance": 0.25},
        "lamp": {"type": "point", "position": [-1.5, 0.5, 2], "intensity": {"type": "rgb", "value": [9, 8.5, 8]}},
        "sensor": {
            "type": "perspective",
            "fov": 34,
            "to_world": mi.ScalarTransform4f().look_at(origin=[0.6, -0.4, 2], target=[0, -0.5, 0], up=[0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 256, "height": 384, "pixel_format": "rgba"},
        },
    }
)
print(scene.shapes()[0].bsdf())
done = render(scene, samples)
save_picture(output, done.image)
print(f"{output}: {done.spp} samples a pixel in {done.seconds:.1f} s")
