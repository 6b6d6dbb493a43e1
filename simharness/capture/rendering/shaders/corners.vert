#version 330 core
// Faces with separate corners. pyrender replaces the names in capitals by attribute locations.

layout(location = 0) in vec3 position;
layout(location = NORMAL_LOC) in vec3 normal;
#ifdef TEXCOORD_0_LOC
layout(location = TEXCOORD_0_LOC) in vec2 corner;
#endif
layout(location = COLOR_0_LOC) in vec4 color;
layout(location = INST_M_LOC) in mat4 instance;

uniform mat4 M;
uniform mat4 V;
uniform mat4 P;

out vec3 at;
out vec3 outwards;
out vec2 place;
out vec4 albedo;

void main()
{
    vec4 world = M * instance * vec4(position, 1.0);
    gl_Position = P * V * world;
    at = world.xyz;
    outwards = normal;
#ifdef TEXCOORD_0_LOC
    place = corner;
#else
    place = vec2(0.0);
#endif
    albedo = color;
}
