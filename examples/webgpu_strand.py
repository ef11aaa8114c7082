"""A strand's scattering by WebGPU: python examples/webgpu_strand.py [OUTPUT.png], once `pip install wgpu` is done.

Left, f cos of every direction of the light, for a viewer 30 degrees off the strand's normal plane: theta_i upward, phi to
the right. Right, a ball of such strands. Both call functions of the exported file, which reads its tables from a texture.
"""

import sys

import matplotlib.image
import numpy as np
import wgpu

import cuticle
from cuticle.export import export

WIDTH, HEIGHT = 1024, 512
DRAW = """
@vertex fn corner(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {  // of a triangle over all pixels
    return vec4<f32>(f32(i32(i & 1u) * 4 - 1), f32(i32(i >> 1u) * 4 - 1), 0.0, 1.0);
}

fn map(at: vec2<f32>) -> vec3<f32> {
    let theta_i = 1.55 * at.y;
    return 6.0 * cos(theta_i) * fibre_eval(theta_i, 0.5236, 3.1415 * at.x, 0.0);
}

// Strands run down a sphere from its top, which leans toward the viewer; each is a little askew.
fn ball(at: vec2<f32>) -> vec3<f32> {
    let r = dot(at, at) / 0.85;
    if (r >= 1.0) {
        return vec3<f32>(0.02);
    }
    let normal = vec3<f32>(at / sqrt(0.85), sqrt(1.0 - r));
    let top = normalize(vec3<f32>(0.1, 1.0, 0.3));
    let across = normalize(cross(normal, top));
    let side = normalize(cross(top, vec3<f32>(1.0, 0.0, 0.0)));
    let longitude = atan2(dot(across, side), dot(across, cross(side, top)));
    let strand = fract(sin(floor(longitude * 160.0) * 78.233) * 43758.547) - 0.5;
    let along = normalize(cross(across, normal) + 0.25 * strand * normal);
    let out = cross(along, across);
    let light = normalize(vec3<f32>(-0.6, 0.35, 0.7));
    let w_i = vec3<f32>(dot(light, along), dot(light, across), dot(light, out));
    let w_r = vec3<f32>(along.z, across.z, out.z);
    return (24.0 + 20.0 * strand) * fibre_eval_direction(w_r, w_i, 0.0) * smoothstep(-0.2, 0.7, dot(normal, light));
}

@fragment fn pixel(@builtin(position) place: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<f32>(place.x % 512.0, 512.0 - place.y) / 256.0 - 1.0;
    var color: vec3<f32>;
    if (place.x < 512.0) {
        color = map(at);
    } else {
        color = ball(at);
    }
    return vec4<f32>(pow(1.0 - exp(-color), vec3<f32>(1.0 / 2.2)), 1.0);
}
"""

output = sys.argv[1] if len(sys.argv) > 1 else "strand.png"
model = cuticle.Chiang(beta_m=0.2, beta_n=0.3, eumelanin=0.9)
made = export(cuticle.fit(model, lobes=4).sampler, "wgsl", with_model=True)
texels = np.frombuffer(made.data, np.float32).reshape(-1, 1024, 4)

device = wgpu.gpu.request_adapter_sync().request_device_sync()
shader = device.create_shader_module(code=made.text + DRAW)
texture = device.create_texture(size=(1024, len(texels), 1), format="rgba32float", usage="TEXTURE_BINDING | COPY_DST")
device.queue.write_texture({"texture": texture}, texels, {"bytes_per_row": 16 * 1024}, texture.size)
kind = {"binding": 0, "visibility": "FRAGMENT", "texture": {"sample_type": "unfilterable-float"}}
layouts = [device.create_bind_group_layout(entries=[]), device.create_bind_group_layout(entries=[kind])]
pipeline = device.create_render_pipeline(
    layout=device.create_pipeline_layout(bind_group_layouts=layouts),
    vertex={"module": shader, "entry_point": "corner"},
    primitive={"topology": "triangle-list"},
    fragment={"module": shader, "entry_point": "pixel", "targets": [{"format": "rgba8unorm"}]},
)
target = device.create_texture(size=(WIDTH, HEIGHT, 1), format="rgba8unorm", usage="RENDER_ATTACHMENT | COPY_SRC")
encoder = device.create_command_encoder()
attachment = {"view": target.create_view(), "load_op": "clear", "store_op": "store"}
drawing = encoder.begin_render_pass(color_attachments=[attachment])
drawing.set_pipeline(pipeline)
given = [[], [{"binding": 0, "resource": texture.create_view()}]]
for group, (layout, entries) in enumerate(zip(layouts, given, strict=True)):
    drawing.set_bind_group(group, device.create_bind_group(layout=layout, entries=entries))
drawing.draw(3)
drawing.end()
device.queue.submit([encoder.finish()])
pixels = device.queue.read_texture({"texture": target}, {"bytes_per_row": 4 * WIDTH}, target.size)
matplotlib.image.imsave(output, np.frombuffer(pixels, np.uint8).reshape(HEIGHT, WIDTH, 4))
print(f"{output}: drawn by {device.adapter.info['device']}")
