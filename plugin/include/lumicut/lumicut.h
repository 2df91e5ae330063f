/* Lumicut: many-lights global illumination for any host renderer. The whole C ABI. C99 and later, C++ too.
 *
 * A picture (a test compiles and runs these lines):
 *
 *   lumicut_device device = NULL; lumicut_scene scene = NULL;
 *   lumicut_integrator integrator = NULL; lumicut_render render = NULL;
 *   const lumicut_device_desc threads = {.struct_size = sizeof threads, .abi_major = LUMICUT_ABI_MAJOR};  // 0 threads: all
 *   const lumicut_material grey = {.struct_size = sizeof grey, .diffuse = {0.7f, 0.7f, 0.7f}};
 *   const float corners[] = {-2, 0, -2,  2, 0, -2,  2, 0, 2,  -2, 0, 2};
 *   const uint32_t triangles[] = {0, 2, 1,  0, 3, 2};
 *   const lumicut_mesh ground = {.struct_size = sizeof ground, .positions = corners, .vertex_count = 4,
 *                                .indices = triangles, .triangle_count = 2};
 *   const lumicut_light lamp = {.struct_size = sizeof lamp, .type = LUMICUT_POINT, .unit = LUMICUT_WATT,
 *                               .color = {1, 1, 1}, .value = 100, .position = {0, 2, 0}};
 *   const lumicut_camera camera = {.struct_size = sizeof camera, .to_world = {1,0,0,0, 0,1,0,1, 0,0,1,5}, .fov_y = 0.8f};
 *   const lumicut_render_desc frame = {.struct_size = sizeof frame, .width = 640, .height = 480};
 *   static float radiance[3 * 640 * 480];                     // rows from the top
 *   lumicut_device_create(&threads, &device);
 *   lumicut_scene_create(device, NULL, &scene);
 *   lumicut_scene_set_materials(scene, &grey, 1);
 *   lumicut_scene_add_mesh(scene, &ground, NULL);
 *   lumicut_scene_set_lights(scene, &lamp, 1);
 *   lumicut_scene_set_camera(scene, &camera);
 *   lumicut_scene_commit(scene);
 *   lumicut_integrator_create(device, "lightcuts", &integrator);
 *   lumicut_integrator_set(integrator, "vpls", "10000");
 *   lumicut_render_start(integrator, scene, &frame, &render);  // in the background
 *   if (lumicut_render_wait(render, LUMICUT_FOREVER, NULL) != LUMICUT_OK) puts(lumicut_last_error());
 *   lumicut_render_read(render, "radiance", NULL, radiance);
 *   lumicut_release(render); lumicut_release(integrator); lumicut_release(scene); lumicut_release(device);
 *
 * Space     world is right-handed, metres (or any unit, used throughout); colour is linear Rec.709; angles are radians;
 *           radiance W/(sr m2), intensity W/sr, irradiance W/m2. Matrices are row-major 3x4 affine maps (p' = M p).
 * Growth    every descriptor starts with struct_size = sizeof(itself). Fields are only ever appended: missing ones take
 *           their defaults (what 0 means), a non-zero unknown tail gives LUMICUT_UNSUPPORTED. An array of descriptors is
 *           strided by the struct_size of its first element, which all share. Of a descriptor that the library fills, the
 *           fields that fit are written and an unknown tail is zeroed. `reserved` fields must be 0.
 * Errors    functions return a lumicut_result; lumicut_last_error() then gives this thread's text, naming field and
 *           value. A call that fails leaves its object as it was. Bad input never crashes; nothing is thrown.
 * Memory    inputs are copied before the call returns, unless said. Outputs named "view" are borrowed: valid until the
 *           next call on the object that is not [any]. Strings returned are borrowed in the same way.
 * Handles   are counted: create gives one reference, lumicut_retain adds one, lumicut_release takes one (NULL is
 *           allowed). An object keeps what it stands on alive: a render its scene, a scene its device.
 * Threads   [any] call from any thread at any time; [object] the host serialises calls on one object; [shared] may run
 *           concurrently with other [shared] calls on the same object.
 * Callbacks return void and write their answer through a pointer that is preset to "nothing". They may be called from
 *           any thread, concurrently. They must not call back into the object that calls them.                        */
#ifndef LUMICUT_H
#define LUMICUT_H

#include <stdint.h>

/* Fields and their comments stay tables. */
/* clang-format off */

#if defined(LUMICUT_BUILDING)
#define LUMICUT_API __attribute__((visibility("default")))
#else
#define LUMICUT_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define LUMICUT_ABI_MAJOR 1
#define LUMICUT_ABI_MINOR 4
#define LUMICUT_FOREVER 0xffffffffu /* milliseconds */
#define LUMICUT_NO_ID 0xffffffffu   /* no hit, no child */

typedef int32_t lumicut_result;
enum {
  LUMICUT_OK = 0, LUMICUT_INVALID_ARGUMENT = 1, LUMICUT_INVALID_STATE = 2, LUMICUT_UNSUPPORTED = 3,
  LUMICUT_OUT_OF_MEMORY = 4, LUMICUT_CANCELLED = 5, LUMICUT_INTERNAL = 6
};

typedef struct lumicut_device_t* lumicut_device;
typedef struct lumicut_accel_t* lumicut_accel;
typedef struct lumicut_scene_t* lumicut_scene;
typedef struct lumicut_integrator_t* lumicut_integrator;
typedef struct lumicut_render_t* lumicut_render;
/* Programs in place of textures, and what they ask of meshes: described in lumicut_programs.h. */
typedef struct lumicut_program lumicut_program;
typedef struct lumicut_attribute lumicut_attribute;

/* ---- Library and devices ------------------------------------------------------------------------------------------ */

LUMICUT_API const char* lumicut_version(uint32_t* abi_major, uint32_t* abi_minor); /* [any] "1.0.0"; either may be NULL */
LUMICUT_API const char* lumicut_last_error(void); /* [any] this thread's last failure; "" if none */

typedef struct lumicut_device_desc {
  uint32_t struct_size;
  uint32_t abi_major; /* LUMICUT_ABI_MAJOR of the host; another gives LUMICUT_UNSUPPORTED */
  int32_t threads;    /* 0: all */
  int32_t verbosity;  /* 0 errors, 1 warnings, 2 information, 3 debugging */
  void (*log)(void* user, int32_t level, const char* text); /* NULL: silent */
  void* user;
} lumicut_device_desc;

LUMICUT_API lumicut_result lumicut_device_create(const lumicut_device_desc* desc, lumicut_device* device); /* [any] */
LUMICUT_API void lumicut_retain(void* handle);  /* [any] any handle */
LUMICUT_API void lumicut_release(void* handle); /* [any] a running render is cancelled and waited for */

/* ---- Level 2, scenes: materials, meshes, lights, a camera --------------------------------------------------------- */

typedef struct lumicut_scene_desc {
  uint32_t struct_size;
  uint32_t robust;     /* as in lumicut_accel_desc: watertight unless LUMICUT_FAST */
  const char* accel;   /* as `kind` there; the host's own with lumicut_scene_set_trace */
  const char* builder; /* as there */
} lumicut_scene_desc;

typedef struct lumicut_material {
  uint32_t struct_size;
  uint32_t flags;          /* LUMICUT_EMIT_BOTH_SIDES; LUMICUT_PHONG: the specular lobe is Phong's, LUMICUT_GGX: GGX's, else Blinn's */
  float diffuse[3];        /* kd, 0..1; with a texture 0..1e6: their product is cut to 0..1, place by place */
  float shininess;         /* n, the lobe's exponent, >= 0 */
  float specular[3];       /* ks, as diffuse: Blinn ks (n+2)/2pi cos^n(beta); Phong ks/2pi cos^n(beta); see docs/scene_format.md */
  float opacity;           /* share of the rays that the surface stops, times its texture; 0: not given, taken as 1; below 1/256 a hole */
  float emission[3];       /* radiance, on the side the geometric normal points to */
  int32_t diffuse_texture, specular_texture, opacity_texture, emission_texture; /* 1 + index into the textures; 0: none. Factors multiply */
  /* LUMICUT_GGX alone: diffuse is the base colour, specular multiplies the dielectric's reflectance ((ior-1)/(ior+1))^2.
     With LUMICUT_NO_FRESNEL specular is the lobe's reflectance at every angle, beside a Lambertian diffuse (which shading
     trees call a mix of diffuse and glossy): diffuse + specular <= 1 keeps energy; no metallic, transmission.
     With LUMICUT_BURLEY the diffuse part is Burley's (2012), and coats add to it without taking from it: Blender's
     Principled shader before 4.0. It may reflect more than it gets.
     With LUMICUT_SHADOWS_PASS, where transmission is above 0, light goes straight through the glass, dimmed by Fresnel's
     equations and its colour at each border, so that lamps shine through windows; the camera sees it bent as ever.
     Shadow rays pass by chance, by the luminance of what passes; no caustics of this glass */
  float roughness;         /* 0..1; the distribution's alpha is its square */
  float metallic;          /* 0..1 */
  float ior;               /* 0.1..10; 0: not given, taken as 1.5 */
  float transmission;      /* 0..1: share of glass in what is not metal */
  /* Any model */
  int32_t normal_texture;  /* 1 + index; 0: none. Linear; (r, g, b) is (1 + n)/2 of the normal along u, v and out of the surface */
  float normal_strength;   /* 0..10; 0: not given, taken as 1 */
  int32_t height_texture;  /* 1 + index; 0: none. Linear; its luminance is how far the surface stands out, in bump_distance */
  float bump_distance;     /* of a height of 1, in units of the world; below 0: inwards; 0: not given, taken as 1 */
  float bump_strength;     /* 0..10, of the turned normal over the old one; 0: not given, taken as 1 */
  /* LUMICUT_GGX alone: textures are linear and multiply, green the roughness and blue the share of metal, as in glTF */
  int32_t roughness_texture, metallic_texture; /* 1 + index; 0: none */
  float coat;              /* 0..1: share of a clear coat above all of it */
  float coat_roughness;    /* 0..1, as roughness */
  float coat_ior;          /* 1..10; 0: not given, taken as 1.5 */
  /* Any model */
  float translucency[3];   /* as diffuse: share of the light that leaves evenly on the other side; diffuse + translucency <= 1 keeps energy. GGX's coat, metal and glass take nothing from it */
  int32_t translucency_texture; /* 1 + index; 0: none. Multiplies */
  /* LUMICUT_GGX alone */
  float specular_tint[3];      /* 0..1: of metal at 82 degrees, over its colour there; of what glass reflects; all 0: not given, taken as 1 */
  float absorption[3];         /* 0 or above, 1/length: light inside closed glass falls by exp(-absorption times the way); shadow rays that pass
                                  straight know the mean thickness of the mesh's absorbing faces alone, 2 volume / area. 0 with
                                  LUMICUT_OPEN_GLASS */
  float diffuse_roughness;     /* 0..1, slope of the diffuse part's facets, as of LUMICUT_OREN_NAYAR; 0: Lambert's. Not with LUMICUT_BURLEY */
  int32_t diffuse_roughness_texture; /* 1 + index; 0: none. Linear, its green multiplies */
} lumicut_material;
enum {
  LUMICUT_EMIT_BOTH_SIDES = 1,
  LUMICUT_PHONG = 2,
  LUMICUT_GGX = 4,
  LUMICUT_NO_FRESNEL = 8,
  LUMICUT_BURLEY = 16,
  LUMICUT_SHADOWS_PASS = 32,
  LUMICUT_BUMP_SHADOWS = 128, /* bent normals, of normal and height textures: the diffuse part is dimmed where light comes flatter
                                 than it seems, as Cycles has it */
  LUMICUT_OREN_NAYAR = 256,  /* not with LUMICUT_GGX: the diffuse part is Oren and Nayar's (Fujii's form), facets of the slope `roughness` */
  LUMICUT_FACETS_ONCE = 512, /* with that (Blender before 4.3), or with LUMICUT_GGX (of single scattering): what facets reflect more
                                than once is lost. Of rough metal it leaves evenly otherwise */
  LUMICUT_BRIGHT_LOBE = 2048, /* with LUMICUT_GGX: of rough metal, and of lobes without Fresnel, it makes the lobe brighter instead, as
                                 in Blender since 4.0; eye and light paths differ a little then, as no reciprocal lobe does that */
  LUMICUT_DIFFUSE_ONCE = 4096, /* with LUMICUT_GGX: what the diffuse part's facets (diffuse_roughness) reflect more than once is lost,
                                  as in Blender before 4.3 */
  LUMICUT_OPEN_GLASS = 1024, /* with LUMICUT_SHADOWS_PASS: the surface has no second border, so that what lies behind it lies inside
                                the glass. What goes straight on to there is divided by the square of ior, and what is reflected
                                there is what glass reflects from inside */
  LUMICUT_HOLDOUT = 64 /* camera rays that meet it show black, and count in no channel: alpha is 0 there. Other rays see it */
};

/* Kinds of rays. What shadow rays do not see lets light through; what diffuse rays do not see lights nothing and holds no
   virtual lights, though shadow rays may be stopped by it. Glossy: mirrors, and gloss where rays follow it (in images of
   virtual lights that is what `compensate` does; else gloss shows what diffuse rays see). Transmission: through glass. Straight
   through glass rays stay what they were. */
enum {
  LUMICUT_CAMERA_RAYS = 1,
  LUMICUT_DIFFUSE_RAYS = 2,
  LUMICUT_GLOSSY_RAYS = 4,
  LUMICUT_TRANSMISSION_RAYS = 8,
  LUMICUT_SHADOW_RAYS = 16
};

typedef struct lumicut_mesh {
  uint32_t struct_size;
  uint32_t mask;              /* LUMICUT_CAMERA_RAYS ...: the kinds of rays that see it; 0: all */
  const float* positions;     /* xyz */
  const float* normals;       /* xyz a vertex, for shading; NULL: flat */
  const float* uvs;           /* uv a vertex; NULL: 0 */
  uint64_t vertex_count;
  const uint32_t* indices;    /* three a triangle, counter-clockwise seen from the front */
  uint64_t triangle_count;
  const uint32_t* materials;  /* index a triangle; NULL: `material` for all */
  const float* transforms;    /* one 3x4 an instance; NULL: one instance, as it is */
  uint64_t transform_count;
  uint32_t material;
  uint32_t group;             /* light group of what it emits, 0..2^16-1 */
  const lumicut_attribute* attributes; /* what programs ask for (lumicut_programs.h); NULL: none */
  uint64_t attribute_count;
  uint32_t not_lit_by;        /* light linking: bit n-1: it is not among the receivers of set n (lumicut_light.receivers) */
  uint32_t not_blocking;      /* bit n-1: nor among the blockers of set n */
  uint32_t receivers, blockers; /* sets for what it emits, as those of a light; 0: all */
} lumicut_mesh;

typedef struct lumicut_light {
  uint32_t struct_size;
  uint32_t type;      /* LUMICUT_POINT ... Lights are not seen by the camera and block nothing: an emissive mesh does */
  uint32_t unit;      /* LUMICUT_RADIOMETRIC: value is intensity (point, spot), radiance (rectangle, disk), irradiance on a
                         surface facing it (sun); LUMICUT_WATT: power as Blender's lamps have it (sun: irradiance) */
  uint32_t group;     /* light group, 0..2^16-1 */
  float color[3];     /* multiplies value */
  float value;
  float position[3];  /* centre; not for suns */
  float radius;       /* point, spot: 0, or the radius of a sphere that emits evenly (spot: within its cone); sun: angular radius */
  float direction[3]; /* spot: axis of the cone; sun: the way light travels; rectangle, disk: unused */
  float angle;        /* spot: full opening angle */
  float u[3];         /* rectangle: whole edges; disk (ellipse): whole axes. Emits towards u x v, not from behind */
  float blend;        /* spot: 0 sharp .. 1 soft edge */
  float v[3];
  float spread;       /* rectangle, disk: opening angle, pi (default, also 0) is Lambertian */
  uint32_t spot_cosine; /* 1: intensity also falls with the cosine to the axis (Blender before 4.0) */
  uint32_t profile;   /* point: 1 + index into the profiles set before the lights, about `direction`; value (in watt: over
                         4 pi) multiplies its values, and radius is passed over. 0: none */
  float tangent[3];   /* profile: where its horizontal angle 0 lies, made orthogonal to direction; 0: anywhere */
  uint32_t flags;     /* LUMICUT_FACING_DISK, LUMICUT_NO_SHADOWS */
  uint32_t mask;      /* LUMICUT_CAMERA_RAYS ...: kinds of rays that see it; 0: all but the camera's. What diffuse rays do not see
                         lights no diffuse surface, nor by way of one; glossy: no gloss, and no mirror shows it; transmission: glass
                         does not. Of lamps the camera sees those with a radius or an area, over what lies behind them */
  uint32_t receivers; /* light linking: number of a set, 1..32, of the meshes that it lights; 0: all. What they reflect lights all */
  uint32_t blockers;  /* 1..27: set of the meshes that stand before it; 0: all */
  int32_t texture;    /* rectangle, disk: 1 + index into the textures, an image (no program), which multiplies color where it
                         lies: u from 0 to 1 along u, v along v; 0: none */
} lumicut_light;
/* FACING_DISK: point, spot: a disk of that radius which faces each point that it lights, in place of the sphere (Blender
   before 4.0). NO_SHADOWS: nothing stands before it. */
enum { LUMICUT_FACING_DISK = 1, LUMICUT_NO_SHADOWS = 2 };
enum { LUMICUT_POINT = 0, LUMICUT_SPOT = 1, LUMICUT_RECTANGLE = 2, LUMICUT_DISK = 3, LUMICUT_SUN = 4 };
enum { LUMICUT_RADIOMETRIC = 0, LUMICUT_WATT = 1 };

typedef struct lumicut_camera {
  uint32_t struct_size;
  uint32_t orthographic;
  float to_world[12];   /* looks along -z, +y up, +x right; scale is ignored */
  float fov_y;          /* perspective: vertical opening angle of the whole image */
  float height;         /* orthographic: height of the image in the world */
  float shift[2];       /* lens shift, right and up, in image heights; of panoramas in widths and heights */
  float near_clip, far_clip; /* along the ray's forward axis; far 0: infinity */
  float pixel_aspect;   /* width/height of a pixel; 0: 1 */
  float lens_radius;    /* depth of field; 0: pinhole */
  float focus_distance; /* along the forward axis */
  uint32_t panorama;    /* LUMICUT_EQUIRECTANGULAR ...: all around, in place of fov_y; 0: none. Without lens_radius */
  float fisheye_fov;    /* opening angle, up to 2 pi; beyond it nothing is seen, alpha is 0 */
  float fisheye_lens;   /* equisolid: focal length, in units of sensor */
  float sensor[2];      /* equisolid: width and height of the image on it */
  float longitude[2], latitude[2]; /* equirectangular: from left to right within +-pi, from below to above within +-pi/2; all 0: whole */
} lumicut_camera;
/* Fisheyes are round in a square image, and an ellipse in others (equidistant), or cut by the sensor (equisolid). A mirror
   ball shows all directions as its reflections, seen from afar; a face of an equiangular cube a quarter turn each way. */
enum { LUMICUT_EQUIRECTANGULAR = 1, LUMICUT_FISHEYE_EQUIDISTANT = 2, LUMICUT_FISHEYE_EQUISOLID = 3, LUMICUT_MIRROR_BALL = 4,
       LUMICUT_EQUIANGULAR_CUBE = 5 };

LUMICUT_API lumicut_result lumicut_scene_create(lumicut_device device, const lumicut_scene_desc* desc, lumicut_scene* scene); /* [any] desc NULL: defaults */
/* All setters are [object], replace what was set, and take effect at the next commit. */
LUMICUT_API lumicut_result lumicut_scene_set_materials(lumicut_scene scene, const lumicut_material* materials, uint64_t count);
LUMICUT_API lumicut_result lumicut_scene_add_mesh(lumicut_scene scene, const lumicut_mesh* mesh, uint32_t* id);
LUMICUT_API lumicut_result lumicut_scene_set_lights(lumicut_scene scene, const lumicut_light* lights, uint64_t count);
LUMICUT_API lumicut_result lumicut_scene_set_camera(lumicut_scene scene, const lumicut_camera* camera);
LUMICUT_API lumicut_result lumicut_scene_commit(lumicut_scene scene); /* [object] builds; refused while a render uses the scene */

/* ---- Level 3, integrators: chosen by name, set by text ------------------------------------------------------------ */

LUMICUT_API lumicut_result lumicut_integrator_create(lumicut_device device, const char* id, lumicut_integrator* integrator); /* [any] */
LUMICUT_API lumicut_result lumicut_integrator_set(lumicut_integrator integrator, const char* name, const char* value); /* [object] */
LUMICUT_API const char* lumicut_integrator_get(lumicut_integrator integrator, const char* name); /* [object] NULL: no such parameter */

/* ---- Level 4, whole frames ---------------------------------------------------------------------------------------- */

typedef struct lumicut_render_desc {
  uint32_t struct_size;
  uint32_t width, height;
  uint32_t samples;   /* a pixel; 0: 1. One sample lies at the pixel's centre */
  uint32_t crop[4];   /* x0, y0, x1, y1, row 0 on top; all 0: the whole */
  uint32_t tile_size; /* 0: 64 */
  uint32_t passes;    /* whole images, each with virtual lights and samples of its own, averaged; 0: until stopped by what
                         follows, or 1 where nothing follows. Without `compensate` the clamp shrinks from pass to pass */
  float max_seconds;  /* stop after the pass that comes nearest to this; 0: never */
  float target_error; /* stop after at least 8 passes, when lumicut_status.error is at most this; 0: never */
  float confidence;   /* of the interval in the channel `error`; 0: 0.95 */
  uint32_t flags;     /* LUMICUT_CHECKPOINTS: keep what lumicut_render_checkpoint shows; LUMICUT_ILLUMINANCE: fill that
                         channel; LUMICUT_GROUPS: one image for each light group too, in channels "radiance.GROUP";
                         LUMICUT_DENOISE: fill "denoised", "denoised_error" and what a host's own denoiser takes,
                         "denoising_color", "denoising_albedo", "denoising_normal", at the end of at least two passes;
                         with LUMICUT_KEEP_FIREFLIES rare bright samples stay where they fell. Other channels are as without.
                         LUMICUT_DIRECT: the light alone that comes from what emits to what the camera sees, without a surface
                         between */
  const void* checkpoint; /* go on from there: scene, integrator, parameters, the library's version and the fields above but
                             the stops must be the same, and so is the image, bit for bit. One that holds all that is asked
                             for, or more, gives the image that it holds. NULL: begin */
  uint64_t checkpoint_size;
  uint32_t filter;     /* of pixels: LUMICUT_BOX ... */
  float filter_width;  /* in pixels, 0.01..10; box: 1 alone; 0: 1 for the box, else 1.5. The Gaussian exp(-2 (2x/width)^2) ends at
                          1.5 widths from the centre, Blackman-Harris' window at 1 */
  uint32_t lobes;      /* LUMICUT_DIFFUSE_RAYS, GLOSSY, TRANSMISSION: what these lobes of what the camera sees show, alone, without
                          what is seen to emit; the channel albedo is of them too; 0: all */
  float occlusion;     /* above 0: the image is ambient occlusion instead: of the directions above a surface, by their cosine, the
                          share in which nothing lies within this distance; 0: no */
} lumicut_render_desc;
enum { LUMICUT_BOX = 0, LUMICUT_GAUSSIAN = 1, LUMICUT_BLACKMAN_HARRIS = 2 };
enum { LUMICUT_CHECKPOINTS = 1, LUMICUT_ILLUMINANCE = 2, LUMICUT_GROUPS = 4, LUMICUT_DENOISE = 8, LUMICUT_KEEP_FIREFLIES = 16, LUMICUT_DIRECT = 32 };

typedef struct lumicut_status {
  uint32_t struct_size;
  int32_t state;       /* LUMICUT_IDLE ... */
  const char* phase;   /* what runs now, such as "light tree"; static string */
  double fraction;     /* of the phase, 0..1 */
  double seconds;      /* since the work began */
  uint64_t tiles_done; /* renders alone */
  uint64_t tiles_total;
  uint32_t passes_done;  /* renders alone: whole passes */
  uint32_t passes_total; /* 0: until stopped */
  double error;          /* `confidence` of the pixels have a half interval of at most this share of their luminance (of a
                            tenth of the image's mean where that is larger); infinite before two passes */
} lumicut_status;
enum { LUMICUT_IDLE = 0, LUMICUT_RUNNING = 1, LUMICUT_DONE = 2, LUMICUT_STOPPED = 3, LUMICUT_FAILED = 4 };

typedef struct lumicut_tile {
  uint32_t struct_size;
  uint32_t x0, y0, x1, y1;
} lumicut_tile;

/* Starts in the background: prepares the integrator if need be, renders. Integrator and scene may not change meanwhile. */
LUMICUT_API lumicut_result lumicut_render_start(lumicut_integrator integrator, lumicut_scene scene, const lumicut_render_desc* desc, lumicut_render* render); /* [object] both */
LUMICUT_API lumicut_result lumicut_render_wait(lumicut_render render, uint32_t milliseconds, lumicut_status* status); /* [any] returns when done or after that time (0: at once, LUMICUT_FOREVER); a failed render's error comes back here. status may be NULL */
LUMICUT_API lumicut_result lumicut_render_read(lumicut_render render, const char* channel, const lumicut_tile* rect, float* out); /* [any] rect NULL: the crop; rows packed from the top; tiles not done yet are 0; later passes refine */
LUMICUT_API lumicut_result lumicut_render_next_tile(lumicut_render render, lumicut_tile* tile); /* [object] finished tiles, each once; x1 = 0: none now */
/* Light groups that have channels "radiance.GROUP", rising: those of all that emits; empty without LUMICUT_GROUPS. */
LUMICUT_API lumicut_result lumicut_render_groups(lumicut_render render, const uint32_t** groups, uint64_t* count); /* [any] view */
/* State after the last whole pass, for lumicut_render_desc.checkpoint; size 0: none yet. */
LUMICUT_API lumicut_result lumicut_render_checkpoint(lumicut_render render, const void** data, uint64_t* size); /* [object] view */

/* Of accel, scene, integrator or render, while a call of it works in another thread. */
LUMICUT_API lumicut_result lumicut_get_status(void* handle, lumicut_status* status); /* [any] */
LUMICUT_API lumicut_result lumicut_cancel(void* handle); /* [any] what runs returns LUMICUT_CANCELLED soon; the object stays usable; idle: nothing */
LUMICUT_API const char* lumicut_stats_json(void* handle); /* [object] counters and seconds per phase of the last work; view; docs/c_abi.md */

/* ---- More of a scene: textures, measured lamps, an environment, changes ------------------------------------------- */

typedef struct lumicut_texture {
  uint32_t struct_size;
  uint32_t width, height;
  uint32_t channels; /* 1..4 */
  uint32_t format;   /* LUMICUT_UINT8 (0..255 -> 0..1) or LUMICUT_FLOAT32 */
  uint32_t flags;    /* LUMICUT_SRGB: decode; LUMICUT_CLAMP: no repeat; LUMICUT_NEAREST: no filter; LUMICUT_BY_VIEW and
                        LUMICUT_BLEND_STORED: below */
  const void* pixels; /* row 0 is the top row (v = 1), rows packed */
  const lumicut_program* program; /* computes the value in place of an image; all fields above are 0 then. NULL: an image */
} lumicut_texture;
enum { LUMICUT_UINT8 = 0, LUMICUT_FLOAT32 = 1 };
/* With LUMICUT_BY_VIEW the texture is looked up by how the surface is seen, not by uv: its right half is for the front, from
   edge-on to straight on (u by the cosine to the shading normal, between the centres of that half's first and last texels),
   its left half, mirrored, for the back. The width is even. For Fresnel mixes and the like; not for emission, opacity,
   normal, height and environment textures.
   With LUMICUT_BLEND_STORED, which needs LUMICUT_SRGB, texels are blended as they are stored, and the result is decoded, as
   Cycles does with images of 8 bits: dark lines stay darker. Without it they are decoded first, as glTF asks */
enum {
  LUMICUT_SRGB = 1,
  LUMICUT_CLAMP = 2,
  LUMICUT_NEAREST = 4,
  LUMICUT_BY_VIEW = 8,
  LUMICUT_BLEND_STORED = 16
};

/* Intensity by direction, as photometric files have it: bilinear between its angles, 0 beyond the vertical ones. */
typedef struct lumicut_profile {
  uint32_t struct_size;
  uint32_t vertical_count, horizontal_count; /* at least 2; 1 (the same all around) or at least 2 */
  uint32_t reserved;
  const float* vertical;   /* radians from the light's direction, rising within 0..pi */
  const float* horizontal; /* radians about it, rising from 0 to 2 pi; from tangent towards tangent x direction */
  const float* values;     /* W/sr, vertical_count for each horizontal angle */
} lumicut_profile;

typedef struct lumicut_environment {
  uint32_t struct_size;
  uint32_t group;
  float color[3];       /* radiance, multiplies the texture */
  int32_t texture;      /* 1 + index, latitude-longitude; 0: constant */
  float world_to_map[9]; /* row-major rotation; all 0: identity. In map space z is up: u = 1/2 - atan2(y,x)/2pi,
                            v = 1/2 + atan2(z,hypot(x,y))/pi */
  uint32_t flags;       /* LUMICUT_HIDDEN: it lights the scene, but camera rays that leave it bring black */
  uint32_t mask;        /* kinds of rays that see it, as lumicut_light.mask; 0: all. The camera's are LUMICUT_HIDDEN's alone */
} lumicut_environment;
enum { LUMICUT_HIDDEN = 1 };

LUMICUT_API lumicut_result lumicut_scene_set_textures(lumicut_scene scene, const lumicut_texture* textures, uint64_t count);
LUMICUT_API lumicut_result lumicut_scene_set_profiles(lumicut_scene scene, const lumicut_profile* profiles, uint64_t count); /* for lights set after; lights keep theirs */
LUMICUT_API lumicut_result lumicut_scene_set_environment(lumicut_scene scene, const lumicut_environment* environment); /* NULL: black */
/* New positions of the same topology (and normals, or NULL), new transforms (count as before, or NULL: unchanged). */
LUMICUT_API lumicut_result lumicut_scene_update_mesh(lumicut_scene scene, uint32_t id, const float* positions, const float* normals, const float* transforms);

/* ---- What the library offers: integrators, their parameters, channels, extensions --------------------------------- */

typedef struct lumicut_integrator_info {
  uint32_t struct_size;
  uint32_t param_count;
  const char *id, *label, *description, *source; /* source: the paper */
  uint32_t traits;      /* LUMICUT_VIRTUAL_LIGHTS ...; 0: a library before 1.4, which does not tell; every integrator has one */
  uint32_t reserved;
  /* Suggested parameters by purpose, "name=value name=value"; "": no suggestion, NULL: before 1.4. Others keep their defaults. */
  const char* interactive; /* coarse pictures while a view moves */
  const char* preview;     /* small pictures within a second */
  const char* draft;       /* a first look at a frame */
  const char* good;        /* most frames */
  const char* reference;   /* what others are measured against, in many passes */
} lumicut_integrator_info;
enum {
  LUMICUT_VIRTUAL_LIGHTS = 1,   /* shades by virtual lights: has their parameters, and lights to get and set */
  LUMICUT_LIGHT_GROUPS = 2,     /* takes LUMICUT_GROUPS; without it a render with that flag is refused */
  LUMICUT_COMPENSATION = 4,     /* "compensate" brings back what the clamp takes */
  LUMICUT_SAVED_STATE = 8,      /* lumicut_state.h saves and loads what it prepared */
  LUMICUT_VIEW_INDEPENDENT = 16, /* another camera repeats no preparation: nothing is clustered by what is seen */
  LUMICUT_ALL_LIGHTS = 32       /* sums every virtual light at every point: no error of clustering */
};

typedef struct lumicut_param_info {
  uint32_t struct_size;
  uint32_t type; /* LUMICUT_FLOAT ... */
  const char *id, *label, *description, *unit;
  const char* choices;      /* LUMICUT_CHOICE: names separated by '|'; else "" */
  const char* default_text; /* as lumicut_integrator_set takes it */
  double minimum, maximum;  /* of numbers */
} lumicut_param_info;
enum { LUMICUT_FLOAT = 0, LUMICUT_INT = 1, LUMICUT_BOOL = 2, LUMICUT_CHOICE = 3 };

typedef struct lumicut_channel_info {
  uint32_t struct_size;
  uint32_t components; /* 1 or 3 */
  const char *name, *description;
} lumicut_channel_info;

LUMICUT_API lumicut_result lumicut_get_integrator_info(uint32_t index, lumicut_integrator_info* info); /* [any] INVALID_ARGUMENT past the last */
LUMICUT_API lumicut_result lumicut_get_param_info(const char* integrator, uint32_t index, lumicut_param_info* info); /* [any] */
LUMICUT_API lumicut_result lumicut_get_channel_info(uint32_t index, lumicut_channel_info* info); /* [any] "radiance", "alpha", "depth" ... */
LUMICUT_API const void* lumicut_get_extension(const char* id); /* [any] table of an optional extension, NULL if absent */

/* ---- Level 3 with the host's own points: virtual lights in and out, shading --------------------------------------- */

typedef struct lumicut_vpl {
  float position[3];  /* oriented, sphere: on its surface; directional: unused */
  uint32_t kind;      /* LUMICUT_VPL_OMNI ... */
  float normal[3];    /* unit; oriented, sphere: I falls with max(0, cos); directional: the way light travels; spot: axis */
  uint32_t group;     /* light group it came from */
  float intensity[3]; /* W/sr along the normal; directional: irradiance, W/m2 */
  float cos_outer;    /* spot: falls to 0 at this cosine; sphere: its radius, above 0 */
  float blend;        /* spot: smoothstep over this much of cosine */
  float spot_cosine;  /* spot: 1: times the cosine too */
  float spread_tan;   /* spot: narrowed area lamps fall off with max(0, 1 - spread_tan tan(theta)); 0: no */
  uint32_t profile;   /* spot: name of a profile that a scene or lights of this process hold, in place of this falloff; then blend,
                         spot_cosine and spread_tan are its tangent, and intensity is that of its largest value; 0: none */
} lumicut_vpl;
enum { LUMICUT_VPL_OMNI = 0, LUMICUT_VPL_ORIENTED = 1, LUMICUT_VPL_DIRECTIONAL = 2, LUMICUT_VPL_SPOT = 3,
       LUMICUT_VPL_SPHERE = 4 /* an oriented light spread over a ball */ };

typedef struct lumicut_point { /* a surface point of the host's, 64 bytes */
  float position[3];
  uint32_t material;         /* of the scene */
  float normal[3];           /* shading normal, unit */
  float u;
  float geometric_normal[3]; /* unit */
  float v;
  float to_viewer[3];        /* unit */
  uint32_t pixel;            /* points of one pixel lie together; methods that share work within a pixel use it */
} lumicut_point;

/* The host's own VPLs, instead of those traced from the scene; count 0: trace again. lumicut_lights.h also
 * takes where they come from. */
LUMICUT_API lumicut_result lumicut_integrator_set_lights(lumicut_integrator integrator, const lumicut_vpl* lights, uint64_t count); /* [object] */
LUMICUT_API lumicut_result lumicut_integrator_prepare(lumicut_integrator integrator, lumicut_scene scene); /* [object] traces VPLs, builds trees; keeps the scene */
LUMICUT_API lumicut_result lumicut_integrator_get_lights(lumicut_integrator integrator, const lumicut_vpl** lights, uint64_t* count); /* [object] view, after prepare */
/* Reflected radiance towards the viewer, three floats a point. A pure function of the seed and the input. */
LUMICUT_API lumicut_result lumicut_integrator_shade(lumicut_integrator integrator, const lumicut_point* points, uint64_t count, float* radiance); /* [shared] after prepare */

/* ---- Level 1, rays: the host's tracer for a scene, and accel, rays against triangles or boxes --------------------- */

/* Fields are Embree's, in Embree's order. */
typedef struct lumicut_ray {
  float org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, time, tfar;
  uint32_t mask, id, flags;
} lumicut_ray;
typedef struct lumicut_hit {
  float ng_x, ng_y, ng_z, u, v;
  uint32_t prim_id, geom_id, inst_id; /* geom_id is LUMICUT_NO_ID where nothing was hit */
} lumicut_hit;
typedef struct lumicut_rayhit {
  lumicut_ray ray;
  lumicut_hit hit;
} lumicut_rayhit;

/* The host's own tracer, in batches: fill hits (closest) / set tfar = -inf (occluded). geom_id is the mesh's id, inst_id the
   index of its transform. */
typedef struct lumicut_trace {
  uint32_t struct_size;
  uint32_t batch; /* most rays a call; 0: 65536 */
  void (*intersect)(void* user, lumicut_rayhit* rays, uint64_t count);
  void (*occluded)(void* user, lumicut_ray* rays, uint64_t count);
  void* user;
} lumicut_trace;

typedef struct lumicut_accel_desc {
  uint32_t struct_size;
  uint32_t robust;         /* LUMICUT_ROBUST (default, also 0) or LUMICUT_FAST */
  const char* kind;        /* "bvh" (default), the library's own ("agglomerative" is its name of before 1.3), or "embree" (LUMICUT_UNSUPPORTED where left out) */
  const char* builder;     /* "bvh" alone: see docs/embree_dropin.md; NULL: the default */
  const float* positions;  /* xyz */
  uint64_t position_count;
  uint64_t position_stride; /* bytes; 0: 12 */
  const uint32_t* indices; /* three a triangle */
  uint64_t triangle_count;
  const float* boxes;      /* instead of triangles: six floats a box, lower and upper corner; rays hit the boxes themselves */
  uint64_t box_count;
} lumicut_accel_desc;
enum { LUMICUT_ROBUST = 1, LUMICUT_FAST = 2 }; /* watertight on shared edges; a little faster: some rays slip through them */

typedef struct lumicut_accel_info {
  uint32_t struct_size;
  uint32_t node_count;    /* of the binary tree that lumicut_accel_get_node shows; 0: the kind does not show it */
  uint64_t primitive_count, bytes;
  double build_seconds;
  double expected_boxes, expected_primitives, expected_cost; /* Walter et al. 2008, Fig. 6 */
  float lower[3], upper[3];
} lumicut_accel_info;

typedef struct lumicut_accel_node_info {
  uint32_t struct_size;
  uint32_t left, right;    /* children; LUMICUT_NO_ID in a leaf. Node 0 is the root */
  uint32_t first, count;   /* a leaf's primitives: lumicut_accel_get_primitives' order */
  float lower[3], upper[3];
} lumicut_accel_node_info;

LUMICUT_API lumicut_result lumicut_scene_set_trace(lumicut_scene scene, const lumicut_trace* trace); /* NULL: ours again */

LUMICUT_API lumicut_result lumicut_accel_build(lumicut_device device, const lumicut_accel_desc* desc, lumicut_accel* accel); /* [any] */
LUMICUT_API lumicut_result lumicut_accel_get_info(lumicut_accel accel, lumicut_accel_info* info); /* [shared] */
LUMICUT_API lumicut_result lumicut_accel_get_node(lumicut_accel accel, uint32_t index, lumicut_accel_node_info* node); /* [shared] */
LUMICUT_API lumicut_result lumicut_accel_get_primitives(lumicut_accel accel, const uint32_t** ids, uint64_t* count); /* [shared] view: leaf order -> primitive */
LUMICUT_API lumicut_result lumicut_accel_intersect(lumicut_accel accel, lumicut_rayhit* rays, uint64_t count); /* [shared] closest hits */
LUMICUT_API lumicut_result lumicut_accel_occluded(lumicut_accel accel, lumicut_ray* rays, uint64_t count); /* [shared] tfar = -inf where hit */

#ifdef __cplusplus
}
#endif

#endif /* LUMICUT_H */
