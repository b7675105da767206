// Pass 4, blended ONE, ONE into f_h: one sub-plane, light map times shadow times its share, eq. (10)
// (mirror: atmoref/stages/sub_plane.py).  The depth test keeps what lies in front of the surfaces.

#include "plane.wgsl"
#include "camera.wgsl"
#include "ray_cast.wgsl"
#include "spot_light.wgsl"

@fragment
fn main(given: Fragment) -> @location(0) vec4f {
    let ray = camera_ray(given.position.xy);
    let lit = illuminate(ray, light_ray(ray), planes[given.plane].z, -1);
    return vec4f(lit * planes[given.plane].share, 0.0);
}
