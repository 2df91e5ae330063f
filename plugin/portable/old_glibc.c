/* For a library that is linked on a newer Linux and runs with glibc 2.28 (LUMICUT_PORTABLE). Calls of the library, of
 * libstdc++ and of libgcc, all linked in, meet the functions of this file: the linker takes them before glibc's, and the
 * version script hides them. tests/plugin/test_portable.py reads the versions that are left. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <link.h>
#include <pthread.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

/* ---- Functions that got a new version when they moved into libc, or when their errors changed: the version of before.
 * Arguments and results pass through registers untouched. */

/* clang-format off */
#define OLD(name, version)                                 \
  __asm__(".symver old_" #name "," #name "@" version "\n"  \
          ".text\n"                                        \
          ".globl " #name "\n"                             \
          ".hidden " #name "\n"                            \
          ".type " #name ",@function\n"                    \
          #name ":\n"                                      \
          "  endbr64\n"                                    \
          "  jmp *old_" #name "@GOTPCREL(%rip)\n"          \
          ".size " #name ",.-" #name "\n")
/* clang-format on */

OLD(exp, "GLIBC_2.2.5"); /* these five: 2.29 tells of errors another way */
OLD(exp2, "GLIBC_2.2.5");
OLD(log, "GLIBC_2.2.5");
OLD(log2, "GLIBC_2.2.5");
OLD(pow, "GLIBC_2.2.5");
OLD(hypotf, "GLIBC_2.2.5");
OLD(dlsym, "GLIBC_2.2.5");
OLD(__pthread_key_create, "GLIBC_2.2.5"); /* libgcc's way to ask whether there are threads */
OLD(pthread_attr_getstack, "GLIBC_2.2.5");
OLD(pthread_attr_setstacksize, "GLIBC_2.2.5");
OLD(pthread_create, "GLIBC_2.2.5");
OLD(pthread_detach, "GLIBC_2.2.5");
OLD(pthread_getattr_np, "GLIBC_2.2.5");
OLD(pthread_getspecific, "GLIBC_2.2.5");
OLD(pthread_join, "GLIBC_2.2.5");
OLD(pthread_key_create, "GLIBC_2.2.5");
OLD(pthread_key_delete, "GLIBC_2.2.5");
OLD(pthread_once, "GLIBC_2.2.5");
OLD(pthread_rwlock_rdlock, "GLIBC_2.2.5");
OLD(pthread_rwlock_unlock, "GLIBC_2.2.5");
OLD(pthread_rwlock_wrlock, "GLIBC_2.2.5");
OLD(pthread_setspecific, "GLIBC_2.2.5");

/* ---- What glibc 2.28 has not. */

/* libstdc++ counts references without atomics where this is not 0: never here. */
char __libc_single_threaded = 0; /* 2.32 */

/* 2.33; before, programs called this with the version of the structure, 1 on x86-64. */
__asm__(".symver old_fxstat64,__fxstat64@GLIBC_2.2.5");
int old_fxstat64(int version, int file, struct stat64* out);
int fstat64(int file, struct stat64* out) { return old_fxstat64(1, file, out); }

/* 2.36, of std::random_device, which the library does not use. */
uint32_t arc4random(void) {
  uint32_t value = 0;
  if (getentropy(&value, sizeof value) != 0) abort();
  return value;
}

/* 2.30. On the clock of pthread_cond_timedwait, which a change of the date moves: those that wait look again. */
int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t clock,
                           const struct timespec* end) {
  struct timespec now, until;
  clock_gettime(clock, &now);
  clock_gettime(CLOCK_REALTIME, &until);
  until.tv_sec += end->tv_sec - now.tv_sec;
  until.tv_nsec += end->tv_nsec - now.tv_nsec;
  if (until.tv_nsec < 0) until.tv_nsec += 1000000000, --until.tv_sec;
  if (until.tv_nsec >= 1000000000) until.tv_nsec -= 1000000000, ++until.tv_sec;
  return pthread_cond_timedwait(condition, mutex, &until);
}

/* 2.35. libgcc asks which loaded object an address lies in, for every frame that an exception leaves. */
struct Search {
  ElfW(Addr) address;
  struct dl_find_object* out;
};

static int in_object(struct dl_phdr_info* info, size_t size, void* user) {
  struct Search* search = user;
  const ElfW(Phdr)* inside = NULL;
  const ElfW(Phdr)* frames = NULL;
  ElfW(Addr) low = (ElfW(Addr)) - 1, high = 0;
  (void)size;
  for (int i = 0; i < info->dlpi_phnum; ++i) {
    const ElfW(Phdr)* p = &info->dlpi_phdr[i];
    const ElfW(Addr) start = info->dlpi_addr + p->p_vaddr;
    if (p->p_type == PT_GNU_EH_FRAME) frames = p;
    if (p->p_type != PT_LOAD) continue;
    if (search->address >= start && search->address < start + p->p_memsz) inside = p;
    if (start < low) low = start;
    if (start + p->p_memsz > high) high = start + p->p_memsz;
  }
  if (inside == NULL) return 0;
  if (frames == NULL) return -1;
  memset(search->out, 0, sizeof *search->out);
  search->out->dlfo_map_start = (void*)low;
  search->out->dlfo_map_end = (void*)high;
  search->out->dlfo_eh_frame = (void*)(info->dlpi_addr + frames->p_vaddr);
  return 1;
}

int _dl_find_object(void* address, struct dl_find_object* out) {
  struct Search search = {(ElfW(Addr))address, out};
  return dl_iterate_phdr(in_object, &search) == 1 ? 0 : -1;
}
