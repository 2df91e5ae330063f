/* Extension "lumicut.presets/1": named qualities for whole frames, from the quickest to what others are measured against.
 * The command and the Blender add-on offer these.
 * lumicut_get_extension("lumicut.presets/1") gives the table. The rules of lumicut.h hold here too. */
#ifndef LUMICUT_PRESETS_H
#define LUMICUT_PRESETS_H

#include "lumicut.h"

#ifdef __cplusplus
extern "C" {
#endif

#define LUMICUT_PRESETS_EXTENSION "lumicut.presets/1"

typedef struct lumicut_preset {
  const char *id, *label, *description;
  const char* integrator;
  const char* parameters; /* of the integrator: "name=value name=value"; others keep their defaults */
  /* of lumicut_render_desc; what is not here stays 0 */
  uint32_t samples, passes, flags;
  float target_error;
} lumicut_preset;

typedef struct lumicut_presets_extension {
  uint32_t struct_size; /* of the table that the library has */
  uint32_t count;
  const lumicut_preset* presets; /* `count` of them; they live as long as the library */
  uint32_t usual;                /* index of the one to take when nobody chose */
  uint32_t reserved;
} lumicut_presets_extension;

#ifdef __cplusplus
}
#endif
#endif
