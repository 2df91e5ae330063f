/* Extension "lumicut.lights/1": virtual lights together with what is known of where they come from. Lights that go out and
 * come in again through it render the same image bit for bit (but for point and spot lamps with a radius, which come in as
 * points on their disk); through lumicut_integrator_set_lights they come in as a host's
 * own, of which nothing is known: how near they may come to points then follows how densely all of them lie.
 * lumicut_get_extension("lumicut.lights/1") gives the table. The rules of lumicut.h hold here too. */
#ifndef LUMICUT_LIGHTS_H
#define LUMICUT_LIGHTS_H

#include "lumicut.h"

#ifdef __cplusplus
extern "C" {
#endif

#define LUMICUT_LIGHTS_EXTENSION "lumicut.lights/1"

typedef struct lumicut_vpl_origin {
  uint32_t source; /* LUMICUT_SOURCE_PATH ... */
  float offset;    /* how far shadow rays start off its surface, scene units; 0: not known, found from the scene */
  float area;      /* LUMICUT_SOURCE_AREA: m2 of the emitter that it stands for, above 0; else 0 */
  /* LUMICUT_SOURCE_PATH, oriented, on a surface that is not Lambert's: its diffuse lobe, by which the library shades with it in
     place of the cosine alone; slope, retro, dim and falloff all 0: Lambert's. docs/decisions/0032-lobed-lights.md */
  float mirror[3]; /* unit: where a mirror at its place would throw its light */
  float slope;     /* of Oren and Nayar's facets, 0 to 1 */
  float again;     /* 0 to 1: what those reflect more than once */
  float retro;     /* of Burley's lobe: 2 roughness, 0 to 2 */
  float dim;       /* 0 to 1/2 */
  float falloff;   /* 0 to 1, beneath gloss: of what leaves at a cosine c so much times (1 - c)^4 is lost */
  float
      lobe_mean; /* mean of the lobe over Lambert's, above 0 where there is one: intensity holds it, so that hosts may take the
                      light for a Lambertian one of the same power */
} lumicut_vpl_origin;
enum {
  LUMICUT_SOURCE_PATH = 0,  /* a light path that met a surface; or not known: a host's own */
  LUMICUT_SOURCE_POINT = 1, /* an emitter without extent, or a distant one */
  LUMICUT_SOURCE_AREA = 2   /* a place that was drawn on an emitter with extent */
};

typedef struct lumicut_vpl_set {
  uint32_t struct_size;
  uint32_t reserved; /* 0 */
  uint64_t count;
  const lumicut_vpl* lights;
  const lumicut_vpl_origin* origins; /* as many, lights of one path after each other; NULL: nothing is known */
  uint64_t light_paths;              /* that were traced; for the statistics alone */
  uint64_t emitter_samples;          /* that were drawn on emitters with extent, those that gave no light included */
} lumicut_vpl_set;

typedef struct lumicut_lights_extension {
  uint32_t struct_size; /* of the table that the library has */
  uint32_t reserved;
  /* [object] As lumicut_integrator_get_lights. Lights of emitters come first. */
  lumicut_result (*get)(lumicut_integrator integrator, lumicut_vpl_set* lights);
  /* [object] As lumicut_integrator_set_lights. Lights may come in any order; those of emitters are put first, else the order
     stays. emitter_samples is at least the number of lights of LUMICUT_SOURCE_AREA. */
  lumicut_result (*set)(lumicut_integrator integrator, const lumicut_vpl_set* lights);
} lumicut_lights_extension;

#ifdef __cplusplus
}
#endif
#endif
