// lumicut_geometry.h: what needs CGAL.
#include "geometry/c_api/api.h"
#include "geometry/dnet.h"
#include "geometry/epsilon_net.h"

using namespace lumicut;
using namespace lumicut::c_api;

extern "C" {

int lumicut_epsilon_net(const double* points, const double* weights, size_t count, double epsilon, int thesis,
                        double c0, uint64_t seed, lumicut_indices* chosen) {
  return guard([&] {
    if (!std::isfinite(c0) || c0 < 0) fail_argument("c0 " + std::to_string(c0) + " is not finite or below 0");
    EpsilonNetOptions o;
    if (thesis != 0) o.mode = EpsilonNetOptions::Mode::thesis;
    o.c0 = c0, o.seed = seed;
    give(epsilon_net(points_of(points, count), {weights, weights == nullptr ? 0 : count}, epsilon, o).points, chosen,
         "chosen");
  });
}

int lumicut_heaviest_unhit_disk(const double* points, const double* weights, size_t count, const uint32_t* net,
                                size_t net_count, double* weight) {
  return guard([&] {
    const auto of_net = array(net, net_count, 1, "net");
    for (const uint32_t i : of_net)
      if (i >= count)
        fail_argument("net: " + std::to_string(i) + " is of none of " + std::to_string(count) + " points");
    required(weight, "weight") =
        heaviest_unhit_disk(points_of(points, count), {weights, weights == nullptr ? 0 : count}, of_net);
  });
}

int lumicut_hitting_set_dnet(const double* points, size_t point_count, const double* disks, size_t disk_count,
                             int drop_empty, uint64_t seed, lumicut_indices* chosen) {
  return guard([&] {
    DnetOptions o;
    o.drop_empty_disks = drop_empty != 0, o.seed = seed;
    give(dnet_hitting_set(points_of(points, point_count), disks_of(disks, disk_count), o).points, chosen, "chosen");
  });
}

}  // extern "C"
