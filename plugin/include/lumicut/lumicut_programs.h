/* Texture programs: what shading trees compute at a hit, in an image's place, and the numbers that meshes carry for them.
 * lumicut_texture.program and lumicut_mesh.attributes point to these. The rules of lumicut.h hold here too.
 *
 * Noise as a texture (constants are -1, -2, ...; instructions 0, 1, ...):
 *
 *   const float constants[] = {0, 0, 0,  5, 5, 5,  2, 2, 2,  0.5f, 0.5f, 0.5f,  1, 1, 1};
 *   const lumicut_instruction steps[] = {
 *     {.op = LUMICUT_OP_POSITION},
 *     {.op = LUMICUT_OP_VECTOR, .mode = 2, .inputs = {0, -2, -1}},                     // times 5
 *     {.op = LUMICUT_OP_NOISE, .mode = 42, .inputs = {1, -1, -3, -4, -3, -1, -5, -1}}}; // three dimensions, normalised
 *   const lumicut_program program = {.struct_size = sizeof program, .instruction_count = 3, .constant_count = 5,
 *                                    .instructions = steps, .constants = constants};
 *   const lumicut_texture texture = {.struct_size = sizeof texture, .program = &program};
 */
#ifndef LUMICUT_PROGRAMS_H
#define LUMICUT_PROGRAMS_H

#include "lumicut.h"

/* clang-format off */

#ifdef __cplusplus
extern "C" {
#endif

/* One value of three numbers; a single number stands in all three. What takes a number reads the first. */
typedef struct lumicut_instruction { /* 48 bytes */
  uint32_t op;       /* LUMICUT_OP_UV ... */
  uint32_t mode;     /* of the operation, below */
  int32_t inputs[8]; /* 0 and above: the value of that instruction, an earlier one; below 0: constant -1 - input. Those that
                        the operation does not take are 0 */
  uint32_t data;     /* an attribute's id, 1 + index into the textures (images alone), or the first number of a part of `table` */
  uint32_t count;    /* of numbers of the table; else 0 */
} lumicut_instruction;

struct lumicut_program {
  uint32_t struct_size;
  uint32_t instruction_count; /* 1..1024; the last one's value is the program's */
  uint32_t constant_count, table_count;
  const lumicut_instruction* instructions;
  const float* constants; /* three numbers each */
  const float* table;
};

/* Values of vertices are linear between them. What a program asks for and a mesh lacks is 0. */
struct lumicut_attribute {
  uint32_t struct_size;
  uint32_t id;         /* the host's own number, each once a mesh */
  uint32_t components; /* 1..4; 12 of instances: a 3x4 affine map for LUMICUT_OP_TRANSFORM */
  uint32_t domain;     /* LUMICUT_OF_VERTICES ... */
  const float* values; /* `components` for each vertex, triangle or instance of the mesh */
};
enum { LUMICUT_OF_VERTICES = 0, LUMICUT_OF_TRIANGLES = 1, LUMICUT_OF_INSTANCES = 2 };

/* A normal_texture that is a program gives the shading normal itself, in the world, on the viewer's side; as an opacity it
   gives a number; elsewhere a colour, or a number in all three. Inputs stand in brackets. Functions are Blender's nodes of
   these names; docs/scene_format.md has more on modes. */
enum {
  /* Of the place. Normals lie on the viewer's side */
  LUMICUT_OP_UV = 0,         /* u, v, 0 */
  LUMICUT_OP_ATTRIBUTE = 1,  /* data: id; mode 0: the first three components, 1: the fourth, or 1 */
  LUMICUT_OP_POSITION = 2,   /* world */
  LUMICUT_OP_NORMAL = 3,     /* mode 0: shading, 1: geometric; world */
  LUMICUT_OP_TO_VIEWER = 4,  /* unit, world */
  LUMICUT_OP_BEHIND = 5,     /* 1 where the back is seen */
  LUMICUT_OP_CAMERA = 6,     /* mode 0: place on the image in its heights from the centre, 1: direction, 2: depth, 3: distance */
  LUMICUT_OP_TRANSFORM = 7,  /* [vector] mode 0: point, 1: vector, 2: normal; count 12: by the table, 0: by the attribute `data` */
  /* Numbers and vectors */
  LUMICUT_OP_MATH = 8,       /* [a, b, c] of numbers; modes 0..40: add, subtract, multiply, divide, multiply_add, power, logarithm,
                                sqrt, inverse_sqrt, absolute, exponent, minimum, maximum, less_than, greater_than, sign, compare,
                                smooth_min, smooth_max, round, floor, ceil, trunc, fract, modulo, floored_modulo, wrap, snap,
                                pingpong, sine, cosine, tangent, arcsine, arccosine, arctangent, arctan2, sinh, cosh, tanh,
                                radians, degrees */
  LUMICUT_OP_VECTOR = 9,     /* [a, b, c] modes 0..26: add, subtract, multiply, divide, multiply_add, cross_product, project, reflect,
                                refract (c: index), faceforward, dot_product, distance, length, scale (b: number), normalize,
                                absolute, minimum, maximum, floor, ceil, fraction, modulo, wrap, snap, sine, cosine, tangent */
  LUMICUT_OP_GREY = 10,      /* [colour] mode 0: luminance, 1: mean of three */
  LUMICUT_OP_SEPARATE = 11,  /* [vector] mode 0..2: which */
  LUMICUT_OP_COMBINE = 12,   /* [x, y, z] */
  LUMICUT_OP_CLAMP = 13,     /* [vector, low, high] mode 1: either may be the lower */
  LUMICUT_OP_MAP_RANGE = 14, /* [vector, from low, from high, to low, to high, steps] mode 0: linear, 1: steps, 2: smooth, 3: smoother;
                                + 4: kept in the range; + 8: 0 where there is none */
  LUMICUT_OP_MAPPING = 15,   /* [vector, place, angles, scale] mode 0: point, 1: texture, 2: vector, 3: normal */
  LUMICUT_OP_ROTATE = 16,    /* [vector, centre, axis or angles, angle] mode 0: axis, 1..3: x, y, z, 4: by three angles; + 5: back */
  /* Colours */
  LUMICUT_OP_MIX = 17,       /* [share, a, b] modes 0..18: mix, darken, multiply, burn, lighten, screen, dodge, add, overlay, soft_light,
                                linear_light, difference, exclusion, subtract, divide, hue, saturation, color, value */
  LUMICUT_OP_COLOR = 18,     /* [colour, b, c, d] mode 0: to HSV, 1: from HSV, 2: to HSL, 3: from HSL, 4: gamma b, 5: brightness b and
                                contrast c, 6: hue b, saturation c, value d */
  LUMICUT_OP_RAMP = 19,      /* [number] table: three numbers for each of count / 3 places from 0 to 1; mode 1: in steps */
  LUMICUT_OP_CURVES = 20,    /* [share, colour] table: the range's ends, then three numbers a place; mode 1: straight on beyond it */
  /* By the view, and normals */
  LUMICUT_OP_FRESNEL = 21,   /* [index or blend, normal] mode 0: of the index, 1: of the blend, 2: facing by the blend */
  LUMICUT_OP_BUMP = 22,      /* [height, strength, distance, normal, width] a normal; width: over which slopes are taken,
                                a share of how far the ray came, 0: 5e-4, about a pixel of two thousand; steps show so wide */
  LUMICUT_OP_NORMAL_MAP = 23, /* [colour, strength] a normal; mode 0: along the mesh's uv, 1: along the attribute `data` */
  /* Patterns. In one dimension w alone counts, in two to three the vector, in four both */
  LUMICUT_OP_NOISE = 24,     /* [vector, w, detail, roughness, lacunarity, offset, gain, distortion] mode: dimensions - 1, + 4 times the kind
                                (fbm, multifractal, hybrid, ridged, hetero), + 20: a colour, + 40: normalised */
  LUMICUT_OP_MUSGRAVE = 25,  /* [vector, w, detail, dimension, lacunarity, offset, gain] mode: dimensions - 1, + 4 times the kind */
  LUMICUT_OP_VORONOI = 26,   /* [vector, w, smoothness, exponent, randomness] mode: dimensions - 1, + 4 times the feature (nearest, second,
                                smooth, distance to edge, radius), + 20 times the metric (euclidean, manhattan, chebyshev, minkowski),
                                + 80 times what: distance, colour, place, its w */
  LUMICUT_OP_WAVE = 27,      /* [vector, distortion, detail, detail scale, detail roughness, phase] mode: 1: rings, + 2 times the direction
                                (x, y, z, diagonal or spherical), + 8 times the profile (sine, saw, triangle) */
  LUMICUT_OP_MAGIC = 28,     /* [vector, distortion] mode: depth 0..10 */
  LUMICUT_OP_BRICK = 29,     /* [vector, mortar size, smoothness, bias, width, height]: share of mortar, of the second colour, 0;
                                table: offset, squash, and the frequencies of rows that have them */
  LUMICUT_OP_CHECKER = 30,   /* [vector] */
  LUMICUT_OP_GRADIENT = 31,  /* [vector] modes 0..6: linear, quadratic, easing, diagonal, radial, quadratic sphere, spherical */
  LUMICUT_OP_WHITE_NOISE = 32, /* [vector, w] mode: dimensions - 1, + 4: a colour */
  /* Images */
  LUMICUT_OP_PROJECT = 33,   /* [vector] mode 0: sphere, 1: tube, 2: latitude and longitude, 3: mirror ball: a place on an image */
  LUMICUT_OP_IMAGE = 34      /* [vector, blend, normal] mode + 1: black outside, + 2: mirrored, + 4: from three sides, by the normal */
};

#ifdef __cplusplus
}
#endif
#endif
