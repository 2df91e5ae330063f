/* Extension "lumicut.state/1": what an integrator prepared, as bytes. For methods whose preparation does not depend on the
 * camera and is worth keeping (such as "wspd"; LUMICUT_SAVED_STATE tells which): prepare and save once, load in any later
 * run, render any view.
 * lumicut_get_extension("lumicut.state/1") gives the table. The rules of lumicut.h hold here too. */
#ifndef LUMICUT_STATE_H
#define LUMICUT_STATE_H

#include "lumicut.h"

#ifdef __cplusplus
extern "C" {
#endif

#define LUMICUT_STATE_EXTENSION "lumicut.state/1"

typedef struct lumicut_state_extension {
  uint32_t struct_size; /* of the table that the library has */
  uint32_t reserved;
  /* [object] What lumicut_integrator_prepare (or a render) made, with its lights and parameters. `bytes` NULL: only the
     number of bytes, in `size`; else `size` is the room there, and becomes the number written. Too little room gives
     LUMICUT_INVALID_ARGUMENT, a method without state LUMICUT_UNSUPPORTED, nothing prepared, or a scene that was changed
     since, LUMICUT_INVALID_STATE. */
  lumicut_result (*save)(lumicut_integrator integrator, void* bytes, uint64_t* size);
  /* [object] In place of lumicut_integrator_prepare: the integrator takes the saved lights and what was built on them. The
     scene is committed and is the one that was prepared in all but its camera. The integrator and all its parameters are
     as they were. Bytes that are damaged, cut, of another version or of another scene give LUMICUT_INVALID_ARGUMENT and
     change nothing. */
  lumicut_result (*load)(lumicut_integrator integrator, lumicut_scene scene, const void* bytes, uint64_t size);
} lumicut_state_extension;

#ifdef __cplusplus
}
#endif
#endif
