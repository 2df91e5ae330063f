// Picks a kernel's instance for a kind of virtual light and for the lobes that points have: outside of its loops.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_CLUSTERING_KERNEL_DISPATCH_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_CLUSTERING_KERNEL_DISPATCH_INL_H_
#undef LUMICUT_CLUSTERING_KERNEL_DISPATCH_INL_H_
#else
#define LUMICUT_CLUSTERING_KERNEL_DISPATCH_INL_H_
#endif

#include "bsdf/shade_points.h"
#include "hwy/highway.h"
#include "lights/vpl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {

// A kernel is a struct with `template <VplKind kKind, Lobes kLobes> static HWY_INLINE ... Run(arguments)`.
template <class Kernel, VplKind kKind, class... Args>
HWY_INLINE auto RunForLobes(Lobes lobes, Args&&... args) {
  if (lobes == Lobes::all) return Kernel::template Run<kKind, Lobes::all>(args...);
  return lobes == Lobes::cosine ? Kernel::template Run<kKind, Lobes::cosine>(args...)
                                : Kernel::template Run<kKind, Lobes::none>(args...);
}

template <class Kernel, class... Args>
HWY_INLINE auto RunKernel(VplKind kind, Lobes lobes, Args&&... args) {
  switch (kind) {
    case VplKind::omni:
      return RunForLobes<Kernel, VplKind::omni>(lobes, args...);
    case VplKind::oriented:
      return RunForLobes<Kernel, VplKind::oriented>(lobes, args...);
    case VplKind::directional:
      return RunForLobes<Kernel, VplKind::directional>(lobes, args...);
    case VplKind::spot:
      return RunForLobes<Kernel, VplKind::spot>(lobes, args...);
    case VplKind::lobed:
      return RunForLobes<Kernel, VplKind::lobed>(lobes, args...);
    case VplKind::sphere:
      break;
  }
  return RunForLobes<Kernel, VplKind::sphere>(lobes, args...);
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
