#version 330 core
// Unlit: label of the part in red, id of the mesh in alpha.

struct Material {
    vec4 base_color_factor;
};

uniform Material material;

in vec4 albedo;

out vec4 frag_color;

void main()
{
    frag_color = vec4(albedo.a, 0.0, 0.0, material.base_color_factor.a);
}
