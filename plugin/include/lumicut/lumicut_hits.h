/* Extension "lumicut.hits/1": what a frame's camera rays meet first, for passes of the host's own that no channel has: indices
 * of objects and materials, texture coordinates, Cryptomatte.
 * lumicut_get_extension("lumicut.hits/1") gives the table. The rules of lumicut.h hold here too. */
#ifndef LUMICUT_HITS_H
#define LUMICUT_HITS_H

#include "lumicut.h"

#ifdef __cplusplus
extern "C" {
#endif

#define LUMICUT_HITS_EXTENSION "lumicut.hits/1"

typedef struct lumicut_first_hit {
  uint32_t mesh;     /* its id; LUMICUT_NO_ID: nothing was hit, and all else is 0 */
  uint32_t instance; /* index of its transform */
  uint32_t triangle;
  uint32_t material; /* of the scene */
  float u, v;        /* barycentric, of the triangle's second and third corners */
} lumicut_first_hit;

typedef struct lumicut_hits_extension {
  uint32_t struct_size; /* of the table that the library has */
  uint32_t reserved;
  /* [shared] Of a committed scene. The rays are those of pass `pass` of lumicut_render_start with `frame` and an integrator
     whose parameter seed is `seed`: frame->samples a pixel of the rectangle (NULL: the crop), pixel after pixel, rows packed
     from the top, into `hits`. lumicut_cancel(scene) ends it: LUMICUT_CANCELLED, and `hits` holds nothing of use. Of `frame` size, samples, crop, filter, and whether passes is 1 count. */
  lumicut_result (*trace)(lumicut_scene scene, const lumicut_render_desc* frame, uint64_t seed, uint64_t pass,
                          const lumicut_tile* rect, lumicut_first_hit* hits);
} lumicut_hits_extension;

#ifdef __cplusplus
}
#endif
#endif
