/* A host in pure C99 that knows the library by dlopen alone: a floor, a block, a lamp; one frame as PPM and PFM.
   c_host LIBRARY OUTPUT-WITHOUT-SUFFIX */
#include <dlfcn.h>
#include <lumicut/lumicut.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 96, HEIGHT = 64 };

/* dlsym gives an object pointer; ISO C has no cast from it to a function's. */
#define LOAD(result, name, parameters)                             \
  result(*name) parameters;                                        \
  do {                                                             \
    void* symbol = dlsym(library, "lumicut_" #name);               \
    if (symbol == NULL) return fail("no function lumicut_" #name); \
    memcpy(&name, &symbol, sizeof symbol);                         \
  } while (0)
#define TRY(call) \
  if ((call) != LUMICUT_OK) return fail(last_error())

static int fail(const char* text) {
  fprintf(stderr, "c_host: %s\n", text);
  return 1;
}

static int write_images(const char* stem, const float* rgb) {
  char path[1024];
  FILE* file;
  int x, y, k;
  snprintf(path, sizeof path, "%s.pfm", stem);
  if ((file = fopen(path, "wb")) == NULL) return fail(path);
  fprintf(file, "PF\n%d %d\n-1.0\n", WIDTH, HEIGHT);
  for (y = HEIGHT - 1; y >= 0; --y) fwrite(rgb + 3 * WIDTH * y, sizeof(float), 3 * WIDTH, file); /* bottom row first */
  fclose(file);
  snprintf(path, sizeof path, "%s.ppm", stem);
  if ((file = fopen(path, "wb")) == NULL) return fail(path);
  fprintf(file, "P6\n%d %d\n255\n", WIDTH, HEIGHT);
  for (y = 0; y < HEIGHT; ++y)
    for (x = 0; x < WIDTH; ++x)
      for (k = 0; k < 3; ++k) fputc((int)(255.0 * pow(fmin(1.0, rgb[3 * (WIDTH * y + x) + k]), 1.0 / 2.2)), file);
  fclose(file);
  return 0;
}

int main(int argc, char** argv) {
  static const float positions[] = {-4, 0, -4, 4, 0, -4, 4, 0, 4, -4, 0, 4, -1, 0, 0, 1, 0, 0, 1, 1.5f, 0, -1, 1.5f, 0};
  static const uint32_t indices[] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7}, of_triangle[] = {0, 0, 1, 1};
  static float rgb[3 * WIDTH * HEIGHT];
  double sum = 0;
  int i;
  void* library;
  lumicut_device device = NULL;
  lumicut_scene scene = NULL;
  lumicut_integrator integrator = NULL;
  lumicut_render render = NULL;
  lumicut_device_desc device_desc = {sizeof device_desc, LUMICUT_ABI_MAJOR, 0, 0, NULL, NULL};
  lumicut_material materials[2] = {{.struct_size = sizeof materials[0], .diffuse = {0.7f, 0.7f, 0.7f}},
                                   {.struct_size = sizeof materials[0], .diffuse = {0.7f, 0.2f, 0.1f}}};
  lumicut_mesh mesh = {0};
  lumicut_light lamp = {0};
  lumicut_camera camera = {0};
  lumicut_render_desc frame = {0};
  lumicut_status status = {0};

  if (argc != 3) return fail("usage: c_host LIBRARY OUTPUT-WITHOUT-SUFFIX");
  if ((library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL)) == NULL) return fail(dlerror());
  LOAD(const char*, last_error, (void));
  LOAD(lumicut_result, device_create, (const lumicut_device_desc*, lumicut_device*));
  LOAD(void, release, (void*));
  LOAD(lumicut_result, scene_create, (lumicut_device, const lumicut_scene_desc*, lumicut_scene*));
  LOAD(lumicut_result, scene_set_materials, (lumicut_scene, const lumicut_material*, uint64_t));
  LOAD(lumicut_result, scene_add_mesh, (lumicut_scene, const lumicut_mesh*, uint32_t*));
  LOAD(lumicut_result, scene_set_lights, (lumicut_scene, const lumicut_light*, uint64_t));
  LOAD(lumicut_result, scene_set_camera, (lumicut_scene, const lumicut_camera*));
  LOAD(lumicut_result, scene_commit, (lumicut_scene));
  LOAD(lumicut_result, integrator_create, (lumicut_device, const char*, lumicut_integrator*));
  LOAD(lumicut_result, integrator_set, (lumicut_integrator, const char*, const char*));
  LOAD(lumicut_result, render_start, (lumicut_integrator, lumicut_scene, const lumicut_render_desc*, lumicut_render*));
  LOAD(lumicut_result, render_wait, (lumicut_render, uint32_t, lumicut_status*));
  LOAD(lumicut_result, render_read, (lumicut_render, const char*, const lumicut_tile*, float*));

  TRY(device_create(&device_desc, &device));
  TRY(scene_create(device, NULL, &scene));
  TRY(scene_set_materials(scene, materials, 2));
  mesh.struct_size = sizeof mesh;
  mesh.positions = positions, mesh.vertex_count = 8;
  mesh.indices = indices, mesh.triangle_count = 4, mesh.materials = of_triangle;
  TRY(scene_add_mesh(scene, &mesh, NULL));
  lamp.struct_size = sizeof lamp;
  lamp.type = LUMICUT_POINT, lamp.unit = LUMICUT_WATT;
  lamp.color[0] = lamp.color[1] = lamp.color[2] = 1, lamp.value = 400;
  lamp.position[0] = 1, lamp.position[1] = 3, lamp.position[2] = 2;
  TRY(scene_set_lights(scene, &lamp, 1));
  camera.struct_size = sizeof camera;
  camera.to_world[0] = camera.to_world[5] = camera.to_world[10] = 1; /* looks along -z */
  camera.to_world[7] = 1, camera.to_world[11] = 5, camera.fov_y = 0.8f;
  TRY(scene_set_camera(scene, &camera));
  TRY(scene_commit(scene));
  TRY(integrator_create(device, "exhaustive", &integrator));
  TRY(integrator_set(integrator, "vpls", "500"));
  frame.struct_size = sizeof frame, frame.width = WIDTH, frame.height = HEIGHT;
  TRY(render_start(integrator, scene, &frame, &render));
  status.struct_size = sizeof status;
  do {
    TRY(render_wait(render, 100, &status));
  } while (status.state == LUMICUT_RUNNING);
  TRY(render_read(render, "radiance", NULL, rgb));
  for (i = 0; i < 3 * WIDTH * HEIGHT; ++i) sum += rgb[i];
  release(render), release(integrator), release(scene), release(device);
  dlclose(library);
  printf("mean radiance %.4f in %.2f s\n", sum / (3 * WIDTH * HEIGHT), status.seconds);
  if (!(sum > 0)) return fail("the image is black");
  return write_images(argv[2], rgb);
}
