#version 330 core
// Shading rule of simharness.types.lighting.Lighting, as in simharness.capture.rendering.shading_kernels; id in alpha.

struct Material {
    vec4 base_color_factor;  // 1, 1, 1, id
#ifdef HAS_BASE_COLOR_TEX
    sampler2D base_color_texture;
#endif
};

uniform Material material;
uniform vec3 cam_pos;
uniform vec3 light;      // unit direction to the key light
uniform vec3 strengths;  // strengths of key, sky and fill light
uniform vec3 tint;
uniform vec4 light_x;    // rows of the projection into the shadow map
uniform vec4 light_y;
uniform vec4 light_w;
uniform sampler2D shadow_map;  // inverse depth from the light of the first surface
uniform float bias;            // in inverse depth
uniform float least_cosine;

in vec3 at;
in vec3 outwards;
in vec2 place;
in vec4 albedo;

out vec4 frag_color;

float blocked(vec4 point, float cosine)
{
    float w = 1.0 / dot(light_w, point);
    vec2 where = vec2(dot(light_x, point), dot(light_y, point)) * w - 1.0;
    w += bias / max(cosine, least_cosine);
    int side = textureSize(shadow_map, 0).x;
    if (min(where.x, where.y) < 0.0 || max(where.x, where.y) >= float(side - 3))
        return 0.0;
    ivec2 corner = ivec2(where);
    // Mostly the corners of the filter agree, and their result is used for all.
    float corners = 0.0;
    for (int k = 0; k < 4; k++)
        corners += float(texelFetch(shadow_map, corner + ivec2(3 * (k & 1), 3 * (k >> 1)), 0).r > w);
    if (corners == 0.0 || corners == 4.0)
        return 0.25 * corners;
    vec2 share = where - vec2(corner);
    float sum = 0.0;  // 4 x 4 comparisons under a sliding box of 3 x 3
    for (int row = 0; row < 4; row++)
        for (int column = 0; column < 4; column++) {
            vec2 weight = vec2(column == 0 ? 1.0 - share.x : (column == 3 ? share.x : 1.0),
                               row == 0 ? 1.0 - share.y : (row == 3 ? share.y : 1.0));
            if (texelFetch(shadow_map, corner + ivec2(column, row), 0).r > w)
                sum += weight.x * weight.y;
        }
    return sum / 9.0;
}

void main()
{
    vec3 n = normalize(outwards) * (gl_FrontFacing ? 1.0 : -1.0);
    vec3 to_camera = (cam_pos - at) * gl_FragCoord.w;  // of length 1 along the optical axis
    float cosine = dot(n, light);
    float lit = cosine > 0.0 ? strengths.x * cosine * (1.0 - blocked(vec4(at, 1.0), cosine)) : 0.0;
    float sky = strengths.y * (0.65 + 0.35 * n.z);
    float fill = strengths.z * clamp(dot(n, to_camera), 0.0, 1.0);
    vec3 color = albedo.rgb * sqrt(min(lit + sky + fill, 4.0) * tint);  // sRGB is about the square root of linear light
#ifdef HAS_BASE_COLOR_TEX
    vec2 texels = vec2(textureSize(material.base_color_texture, 0));
    vec2 right = dFdx(place) * texels, down = dFdy(place) * texels;
    float area = 0.5 * (dot(right, right) + dot(down, down));  // level whose texels are about as large as a pixel
    float level = max(ceil(0.5 * log2(max(0.5 * area, 1.0))), 0.0);
    color *= textureLod(material.base_color_texture, place, level).rgb;
#endif
    frag_color = vec4(clamp(color, 0.0, 1.0), material.base_color_factor.a);
}
