#include "geometry/face_kmeans.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <string>

#include "core/error.h"
#include "core/rng.h"

namespace lumicut {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

// Unit eigenvector of the largest eigenvalue of a symmetric matrix (xx, yy, zz, xy, xz, yz), by repeated squaring.
Vec3d main_axis(std::array<double, 6> m) {
  double best = -1;
  Vec3d axis{1, 0, 0};
  for (int it = 0; it < 24; ++it) {
    const double trace = m[0] + m[1] + m[2];
    if (!(trace > 0)) return axis;
    for (double& x : m) x /= trace;
    const auto [xx, yy, zz, xy, xz, yz] = m;
    m = {xx * xx + xy * xy + xz * xz, xy * xy + yy * yy + yz * yz, xz * xz + yz * yz + zz * zz,
         xx * xy + xy * yy + xz * yz, xx * xz + xy * yz + xz * zz, xy * xz + yy * yz + yz * zz};
  }
  for (const Vec3d& column : {Vec3d{m[0], m[3], m[4]}, Vec3d{m[3], m[1], m[5]}, Vec3d{m[4], m[5], m[2]}})
    if (length2(column) > best) best = length2(column), axis = column;
  return normalize(axis);
}

}  // namespace

FaceKmeans::FaceKmeans(FaceMesh mesh, const FaceKmeansOptions& options) : mesh_(std::move(mesh)), options_(options) {
  graph_ = dual_graph(mesh_);
  if (mesh_.faces.empty()) fail_argument("face clusters: the mesh has no faces");
  if (options_.clusters < 1 || options_.clusters > mesh_.faces.size())
    fail_argument("face clusters: " + std::to_string(options_.clusters) + " clusters of " +
                  std::to_string(mesh_.faces.size()) + " faces");
  const bool sander = options_.metric == FaceKmeansOptions::Metric::sander;
  if (sander ? !(options_.lambda >= 1 && options_.lambda < 1e6) : !(options_.lambda >= 0 && options_.lambda <= 1))
    fail_argument("face clusters: lambda is " + std::to_string(options_.lambda) +
                  (sander ? ", not 1 or more" : ", not in [0, 1]"));
  if (!(options_.normal_tolerance >= 0 && options_.normal_tolerance < 3) ||
      !(options_.seed_tolerance >= 0 && options_.seed_tolerance < 1e3))
    fail_argument("face clusters: the tolerances " + std::to_string(options_.normal_tolerance) + " and " +
                  std::to_string(options_.seed_tolerance) + " are out of range");
  if (!(options_.geodesic >= 0 && options_.geodesic < 1e6))
    fail_argument("face clusters: geodesic is " + std::to_string(options_.geodesic));
  const size_t n = mesh_.faces.size();
  centre_.resize(n), normal_.resize(n), area_.resize(n);
  for (uint32_t f = 0; f < n; ++f) geometry_of(f);
  double sum = 0;
  for (uint32_t f = 0; f < n; ++f)
    for (const uint32_t v : graph_.of(f)) sum += length(centre_[v] - centre_[f]);
  if (!graph_.neighbour.empty() && sum > 0) unit_ = sum / static_cast<double>(graph_.neighbour.size());
  label_.assign(n, kNone), pred_.assign(n, kNone), stamp_.assign(n, 0u);
  dist_.assign(n, kFar), inner_.assign(n, kFar);
  choose_seeds(options_.clusters);
}

void FaceKmeans::geometry_of(uint32_t f) {
  centre_[f] = face_centre(mesh_, f);
  const Vec3d w = face_normal_area(mesh_, f);
  area_[f] = 0.5 * length(w);
  normal_[f] = normalize(w);
}

double FaceKmeans::cost(uint32_t c, uint32_t from, uint32_t to) const {
  if (options_.metric == FaceKmeansOptions::Metric::schlafman) {
    const double cosine = dot(normal_[from], normal_[to]);
    return (1 - options_.lambda) * (1 - std::min(1.0, cosine * cosine)) +
           (options_.lambda + options_.geodesic) * (length(centre_[to] - centre_[from]) / unit_);
  }
  return (std::max(0.0, options_.lambda - dot(cluster_normal_[c], normal_[to])) + options_.geodesic) *
         length(centre_[to] - centre_[from]);
}

void FaceKmeans::bisect(uint32_t k) {
  std::vector<uint32_t> faces(mesh_.faces.size());
  std::iota(faces.begin(), faces.end(), 0u);
  struct Part {
    size_t begin, end;
    uint32_t count;
  };
  std::vector<Part> stack{{0, faces.size(), k}};
  while (!stack.empty()) {
    const Part p = stack.back();
    stack.pop_back();
    Vec3d mean;
    for (size_t i = p.begin; i < p.end; ++i) mean += centre_[faces[i]];
    mean = mean / static_cast<double>(p.end - p.begin);
    if (p.count == 1) {
      uint32_t best = faces[p.begin];
      for (size_t i = p.begin; i < p.end; ++i) {
        const double a = length2(centre_[faces[i]] - mean), b = length2(centre_[best] - mean);
        if (a < b || (a == b && faces[i] < best)) best = faces[i];
      }
      seed_.push_back(best);
      continue;
    }
    std::array<double, 6> m{};
    for (size_t i = p.begin; i < p.end; ++i) {
      const Vec3d d = centre_[faces[i]] - mean;
      m[0] += d.x * d.x, m[1] += d.y * d.y, m[2] += d.z * d.z, m[3] += d.x * d.y, m[4] += d.x * d.z, m[5] += d.y * d.z;
    }
    const Vec3d axis = main_axis(m);
    const uint32_t left = p.count / 2;
    const size_t mid = p.begin + (p.end - p.begin) * left / p.count;
    std::nth_element(faces.begin() + static_cast<std::ptrdiff_t>(p.begin),
                     faces.begin() + static_cast<std::ptrdiff_t>(mid),
                     faces.begin() + static_cast<std::ptrdiff_t>(p.end), [&](uint32_t a, uint32_t b) {
                       const double x = dot(centre_[a], axis), y = dot(centre_[b], axis);
                       return x != y ? x < y : a < b;
                     });
    stack.push_back({mid, p.end, p.count - left});
    stack.push_back({p.begin, mid, left});
  }
}

void FaceKmeans::choose_seeds(uint32_t k) {
  if (options_.random_seeds) {
    std::vector<uint32_t> faces(mesh_.faces.size());
    std::iota(faces.begin(), faces.end(), 0u);
    Rng rng(options_.seed, Stage::test, 11);
    for (uint32_t i = 0; i < k; ++i) {
      std::swap(faces[i], faces[i + rng.next_below(static_cast<uint32_t>(faces.size() - i))]);
      seed_.push_back(faces[i]);
    }
  } else {
    bisect(k);
  }
  // Every component gets a seed: its least face.
  std::vector<uint8_t> seen(mesh_.faces.size(), 0);
  const auto flood = [&](uint32_t start) {
    seen[start] = 1;
    stack_.assign(1, start);
    while (!stack_.empty()) {
      const uint32_t u = stack_.back();
      stack_.pop_back();
      for (const uint32_t v : graph_.of(u))
        if (!seen[v]) seen[v] = 1, stack_.push_back(v);
    }
  };
  for (size_t i = 0, m = seed_.size(); i < m; ++i)
    if (!seen[seed_[i]]) flood(seed_[i]);
  for (uint32_t f = 0; f < seen.size(); ++f)
    if (!seen[f]) seed_.push_back(f), flood(f);
  faces_.resize(seed_.size());
  dirty_.assign(seed_.size(), 1);
  for (const uint32_t s : seed_) cluster_normal_.push_back(normal_[s]);
}

// Fig. 5: one heap with decrease-key.
void FaceKmeans::grow_all_single() {
  const auto n = static_cast<uint32_t>(label_.size());
  std::fill(dist_.begin(), dist_.end(), kFar);
  std::fill(label_.begin(), label_.end(), kNone);
  std::vector<uint32_t> heap, place(n, kNone);
  const auto less = [&](uint32_t a, uint32_t b) {
    return dist_[a] != dist_[b] ? dist_[a] < dist_[b] : label_[a] != label_[b] ? label_[a] < label_[b] : a < b;
  };
  const auto up = [&](size_t i) {
    const uint32_t f = heap[i];
    for (; i > 0 && less(f, heap[(i - 1) / 2]); i = (i - 1) / 2)
      place[heap[i] = heap[(i - 1) / 2]] = static_cast<uint32_t>(i);
    place[heap[i] = f] = static_cast<uint32_t>(i);
  };
  const auto pop = [&] {
    const uint32_t top = heap[0], f = heap.back();
    heap.pop_back();
    place[top] = kNone;
    if (heap.empty()) return top;
    size_t i = 0;
    for (size_t child; (child = 2 * i + 1) < heap.size(); i = child) {
      if (child + 1 < heap.size() && less(heap[child + 1], heap[child])) ++child;
      if (!less(heap[child], f)) break;
      place[heap[i] = heap[child]] = static_cast<uint32_t>(i);
    }
    place[heap[i] = f] = static_cast<uint32_t>(i);
    return top;
  };
  for (uint32_t c = 0; c < seed_.size(); ++c) {
    const uint32_t s = seed_[c];
    if (s == kNone || label_[s] != kNone) continue;
    dist_[s] = 0, label_[s] = c;
    place[s] = static_cast<uint32_t>(heap.size());
    heap.push_back(s);
    up(heap.size() - 1);
  }
  while (!heap.empty()) {
    const uint32_t u = pop(), c = label_[u];
    for (const uint32_t v : graph_.of(u)) {
      const double d = dist_[u] + cost(c, u, v);
      if (d < dist_[v] || (d == dist_[v] && c < label_[v])) {
        dist_[v] = d, label_[v] = c;
        if (place[v] == kNone) place[v] = static_cast<uint32_t>(heap.size()), heap.push_back(v);
        up(place[v]);
      }
    }
  }
  regrown_ = n;
}

// Fig. 6: a heap per cluster (lazy deletion), and one of clusters.
void FaceKmeans::grow_all_nested() {
  std::fill(dist_.begin(), dist_.end(), kFar);
  std::fill(label_.begin(), label_.end(), kNone);
  std::vector<std::vector<Entry>> heaps(seed_.size());
  std::vector<Entry> global;
  const auto later = std::greater<Entry>();
  const auto push = [&](std::vector<Entry>& h, const Entry& e) {
    h.push_back(e);
    std::push_heap(h.begin(), h.end(), later);
  };
  const auto stale = [&](const Entry& e) { return dist_[e.face] != e.key || label_[e.face] != e.cluster; };
  for (uint32_t c = 0; c < seed_.size(); ++c) {
    const uint32_t s = seed_[c];
    if (s == kNone || label_[s] != kNone) continue;
    dist_[s] = 0, label_[s] = c;
    push(heaps[c], {0, c, s});
    push(global, {0, c, s});
  }
  while (!global.empty()) {
    std::pop_heap(global.begin(), global.end(), later);
    const uint32_t c = global.back().cluster;
    global.pop_back();
    auto& h = heaps[c];
    const auto drop = [&] {
      std::pop_heap(h.begin(), h.end(), later);
      h.pop_back();
    };
    while (!h.empty() && stale(h.front())) drop();
    // What the global heap said of this cluster may be out of date; only its present top may grow now.
    if (!h.empty() && (global.empty() || !(h.front() > global.front()))) {
      const Entry e = h.front();
      drop();
      for (const uint32_t v : graph_.of(e.face)) {
        const double d = e.key + cost(c, e.face, v);
        if (d < dist_[v] || (d == dist_[v] && c < label_[v])) {
          dist_[v] = d, label_[v] = c;
          push(h, {d, c, v});
        }
      }
      while (!h.empty() && stale(h.front())) drop();
    }
    if (!h.empty()) push(global, h.front());
  }
  regrown_ = label_.size();
}

void FaceKmeans::grow_incremental() {
  const auto later = std::greater<Entry>();
  heap_.clear();
  touched_.clear();
  regrown_ = 0;
  const auto push = [&](double key, uint32_t c, uint32_t f) {
    heap_.push_back({key, c, f});
    std::push_heap(heap_.begin(), heap_.end(), later);
  };
  ++stamp_now_;
  const auto reset = [&](uint32_t f) {
    if (stamp_[f] != stamp_now_) stamp_[f] = stamp_now_, touched_.push_back(f);
    dist_[f] = kFar, label_[f] = kNone, pred_[f] = kNone;
  };
  if (faces_[0].empty() && label_[seed_[0]] == kNone) {  // nothing has grown yet
    for (uint32_t f = 0; f < label_.size(); ++f) reset(f);
  } else {
    for (uint32_t c = 0; c < faces_.size(); ++c)
      if (dirty_[c])
        for (const uint32_t f : faces_[c]) reset(f);
  }
  // Border sets of what stands, next to what was reset.
  for (size_t i = 0, n = touched_.size(); i < n; ++i)
    for (const uint32_t w : graph_.of(touched_[i]))
      if (label_[w] != kNone && stamp_[w] != stamp_now_) push(dist_[w], label_[w], w);
  for (uint32_t c = 0; c < seed_.size(); ++c) {
    const uint32_t s = seed_[c];
    if (!dirty_[c] || s == kNone || label_[s] != kNone) continue;
    dist_[s] = 0, label_[s] = c;
    push(0, c, s);
  }
  while (!heap_.empty()) {
    std::pop_heap(heap_.begin(), heap_.end(), later);
    const Entry e = heap_.back();
    heap_.pop_back();
    if (dist_[e.face] != e.key || label_[e.face] != e.cluster) continue;
    ++regrown_;
    for (const uint32_t v : graph_.of(e.face)) {
      const double d = e.key + cost(e.cluster, e.face, v);
      if (!(d < dist_[v] || (d == dist_[v] && e.cluster < label_[v]))) continue;
      // What was reached through v is not, any more: reset it, and let everything around it grow in again.
      stack_.assign(1, v);
      while (!stack_.empty()) {
        const uint32_t u = stack_.back();
        stack_.pop_back();
        for (const uint32_t w : graph_.of(u)) {
          if (pred_[w] != u) continue;
          reset(w);
          stack_.push_back(w);
          for (const uint32_t x : graph_.of(w))
            if (label_[x] != kNone && x != v) push(dist_[x], label_[x], x);
        }
      }
      if (stamp_[v] != stamp_now_) stamp_[v] = stamp_now_, touched_.push_back(v);
      dist_[v] = d, label_[v] = e.cluster, pred_[v] = e.face;
      push(d, e.cluster, v);
    }
  }
}

bool FaceKmeans::update_normal(uint32_t c, double tolerance) {
  Vec3d sum;
  for (const uint32_t f : faces_[c]) sum += normal_[f] * area_[f];
  const Vec3d normal = normalize(sum);
  if (normal == cluster_normal_[c]) return false;
  if (tolerance > 0 && length2(normal) > 0 && dot(normal, cluster_normal_[c]) >= std::cos(tolerance)) return false;
  cluster_normal_[c] = normal;
  return true;
}

// Phase 2 on one cluster: the face furthest from the border. Without a border the seed stays.
bool FaceKmeans::recentre(uint32_t c) {
  const uint32_t before = seed_[c];
  if (faces_[c].empty()) {
    seed_[c] = kNone;
    return before != kNone;
  }
  const auto later = std::greater<Entry>();
  heap_.clear();
  for (const uint32_t f : faces_[c]) {
    inner_[f] = kFar;
    for (const uint32_t v : graph_.of(f))
      if (label_[v] != c) {
        inner_[f] = 0;
        heap_.push_back({0, c, f});
        break;
      }
  }
  if (heap_.empty()) {
    if (label_[seed_[c]] != c) seed_[c] = faces_[c][0];
    return seed_[c] != before;
  }
  std::make_heap(heap_.begin(), heap_.end(), later);
  double most = -1;
  uint32_t best = faces_[c][0];
  while (!heap_.empty()) {
    std::pop_heap(heap_.begin(), heap_.end(), later);
    const Entry e = heap_.back();
    heap_.pop_back();
    if (inner_[e.face] != e.key) continue;
    if (e.key > most || (e.key == most && e.face < best)) most = e.key, best = e.face;
    for (const uint32_t v : graph_.of(e.face)) {
      if (label_[v] != c) continue;
      const double d = e.key + cost(c, e.face, v);
      if (d < inner_[v]) {
        inner_[v] = d;
        heap_.push_back({d, c, v});
        std::push_heap(heap_.begin(), heap_.end(), later);
      }
    }
  }
  if (before != kNone && label_[before] == c && most <= inner_[before] * (1 + options_.seed_tolerance)) return false;
  seed_[c] = best;
  return best != before;
}

uint64_t FaceKmeans::hash_state() const {
  uint64_t h = label_.size();
  for (const uint32_t l : label_) h = hash64(h, l);
  for (const uint32_t s : seed_) h = hash64(h, s);
  for (const Vec3d& n : cluster_normal_)
    for (int k = 0; k < 3; ++k) h = hash64(h, std::bit_cast<uint64_t>(n[k]));
  return h;
}

FaceKmeans::State FaceKmeans::iterate() {
  const bool incremental = options_.method == FaceKmeansOptions::Method::incremental;
  std::vector<uint8_t> changed(seed_.size(), 0);
  std::vector<uint32_t> moved;
  if (!incremental) {
    previous_ = label_;
    options_.method == FaceKmeansOptions::Method::single_heap ? grow_all_single() : grow_all_nested();
    for (uint32_t f = 0; f < label_.size(); ++f)
      if (label_[f] != previous_[f]) moved.push_back(f);
  } else {
    if (previous_.size() != label_.size()) previous_ = label_;
    grow_incremental();
    for (const uint32_t f : touched_)
      if (label_[f] != previous_[f]) moved.push_back(f);
  }
  for (const uint32_t f : moved) {
    if (previous_[f] != kNone) changed[previous_[f]] = 1;
    if (label_[f] != kNone) changed[label_[f]] = 1;
  }
  // Clusters that the caller touched (a move, a merge) are centred again although no label may have changed.
  for (uint32_t c = 0; c < seed_.size(); ++c) {
    if (dirty_[c] == 2) changed[c] = 1;
    if (changed[c]) std::erase_if(faces_[c], [&](uint32_t f) { return label_[f] != c; });
  }
  for (const uint32_t f : moved)
    if (label_[f] != kNone) faces_[label_[f]].push_back(f);
  for (uint32_t c = 0; c < seed_.size(); ++c) {
    const uint8_t was = dirty_[c];
    dirty_[c] = 0;
    if (!changed[c]) continue;
    std::sort(faces_[c].begin(), faces_[c].end());
    faces_[c].erase(std::unique(faces_[c].begin(), faces_[c].end()), faces_[c].end());
    // Only a cluster whose seed moved, or whose normal in use turned, grows anew.
    const bool turned = update_normal(c, was == 2 ? 0.0 : options_.normal_tolerance), shifted = recentre(c);
    dirty_[c] = (turned && options_.metric == FaceKmeansOptions::Metric::sander) || shifted;
  }
  if (incremental)
    for (const uint32_t f : moved) previous_[f] = label_[f];
  if (std::none_of(dirty_.begin(), dirty_.end(), [](uint8_t d) { return d != 0; })) return State::converged;
  return history_.insert(hash_state()).second ? State::changed : State::cycle;
}

size_t FaceKmeans::run(size_t limit) {
  for (size_t i = 1; i <= limit; ++i)
    if (iterate() != State::changed) return i;
  return limit;
}

void FaceKmeans::move(std::span<const Vec3d> vertices) {
  if (vertices.size() != mesh_.vertices.size())
    fail_argument("face clusters: " + std::to_string(vertices.size()) + " positions for " +
                  std::to_string(mesh_.vertices.size()) + " vertices");
  FaceMesh moved{{vertices.begin(), vertices.end()}, {}};
  validate_mesh(moved);
  std::vector<uint8_t> vertex_moved(vertices.size());
  for (size_t v = 0; v < vertices.size(); ++v) vertex_moved[v] = !(vertices[v] == mesh_.vertices[v]);
  mesh_.vertices.swap(moved.vertices);
  std::vector<uint8_t> touched(seed_.size(), 0);
  for (uint32_t f = 0; f < label_.size(); ++f) {
    const auto& t = mesh_.faces[f];
    if (!vertex_moved[t[0]] && !vertex_moved[t[1]] && !vertex_moved[t[2]]) continue;
    geometry_of(f);
    if (label_[f] != kNone) touched[label_[f]] = 1;
  }
  // A cluster with a face that moved has other distances; its normal is taken from where it is now.
  for (uint32_t c = 0; c < seed_.size(); ++c)
    if (touched[c]) dirty_[c] = 2, update_normal(c, 0);
  history_.clear();
}

void FaceKmeans::merge(uint32_t a, uint32_t b) {
  if (a == b || a >= faces_.size() || b >= faces_.size())
    fail_argument("face clusters: no clusters " + std::to_string(a) + " and " + std::to_string(b) + " to merge");
  const bool touch = std::any_of(faces_[b].begin(), faces_[b].end(), [&](uint32_t f) {
    const auto near = graph_.of(f);
    return std::any_of(near.begin(), near.end(), [&](uint32_t v) { return label_[v] == a; });
  });
  if (!touch)
    fail_argument("face clusters: clusters " + std::to_string(a) + " and " + std::to_string(b) + " do not touch");
  for (const uint32_t f : faces_[b]) {
    label_[f] = a;
    if (previous_.size() == label_.size()) previous_[f] = a;
  }
  faces_[a].insert(faces_[a].end(), faces_[b].begin(), faces_[b].end());
  std::sort(faces_[a].begin(), faces_[a].end());
  faces_[b].clear();
  seed_[b] = kNone;
  dirty_[a] = 2, dirty_[b] = 0;
  update_normal(a, 0);
  recentre(a);
  history_.clear();
}

uint32_t FaceKmeans::split(uint32_t c) {
  if (c >= faces_.size() || faces_[c].empty())
    fail_argument("face clusters: no cluster " + std::to_string(c) + " to split");
  if (faces_[c].size() < 2) return kNone;
  uint32_t furthest = kNone;
  double most = -1;
  for (const uint32_t f : faces_[c])
    if (f != seed_[c]) {
      const double d = length2(centre_[f] - centre_[seed_[c]]);
      if (d > most) most = d, furthest = f;
    }
  uint32_t id = 0;
  while (id < seed_.size() && seed_[id] != kNone) ++id;
  if (id == seed_.size())
    seed_.push_back(kNone), faces_.emplace_back(), dirty_.push_back(0), cluster_normal_.emplace_back();
  seed_[id] = furthest;
  cluster_normal_[id] = normal_[furthest];
  dirty_[id] = dirty_[c] = 2;
  history_.clear();
  return id;
}

double FaceKmeans::error_of(const std::vector<uint32_t>& faces) const {
  Vec3d sum;
  double area = 0;
  for (const uint32_t f : faces) sum += normal_[f] * area_[f], area += area_[f];
  return area - length(sum);  // = sum of area (1 - n · N)
}

bool FaceKmeans::teleport() {
  std::vector<double> errors(faces_.size());
  uint32_t worst = kNone;
  for (uint32_t c = 0; c < faces_.size(); ++c) {
    errors[c] = error_of(faces_[c]);
    if (faces_[c].size() > 1 && (worst == kNone || errors[c] > errors[worst])) worst = c;
  }
  if (worst == kNone) return false;
  std::vector<std::pair<uint32_t, uint32_t>> pairs;
  for (uint32_t f = 0; f < label_.size(); ++f)
    for (const uint32_t v : graph_.of(f))
      if (label_[f] < label_[v] && label_[v] != kNone) pairs.emplace_back(label_[f], label_[v]);
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  double least = kFar;
  std::pair<uint32_t, uint32_t> best{kNone, kNone};
  std::vector<uint32_t> both;
  for (const auto& [a, b] : pairs) {
    if (a == worst || b == worst) continue;
    both = faces_[a];
    both.insert(both.end(), faces_[b].begin(), faces_[b].end());
    const double extra = error_of(both) - errors[a] - errors[b];
    if (extra < least) least = extra, best = {a, b};
  }
  if (best.first == kNone || !(least < errors[worst])) return false;
  merge(best.first, best.second);
  return split(worst) != kNone;
}

size_t FaceKmeans::refine(double error, size_t most) {
  size_t count = cluster_count();
  while (count<most&& this->error()> error) {
    std::vector<std::pair<double, uint32_t>> worst;
    for (uint32_t c = 0; c < faces_.size(); ++c)
      if (faces_[c].size() > 1) worst.emplace_back(-error_of(faces_[c]), c);
    if (worst.empty()) break;
    std::sort(worst.begin(), worst.end());
    worst.resize(std::min({worst.size(), std::max<size_t>(1, count / 8), most - count}));
    for (const auto& [negative, c] : worst) split(c);
    run(20);
    count = cluster_count();
  }
  return count;
}

size_t FaceKmeans::cluster_count() const {
  return static_cast<size_t>(std::count_if(faces_.begin(), faces_.end(), [](const auto& f) { return !f.empty(); }));
}

size_t FaceKmeans::cut_edges() const {
  size_t cut = 0;
  for (uint32_t f = 0; f < label_.size(); ++f)
    for (const uint32_t v : graph_.of(f)) cut += f < v && label_[f] != label_[v];
  return cut;
}

double FaceKmeans::error() const {
  double sum = 0;
  for (const auto& f : faces_) sum += error_of(f);
  return sum;
}

}  // namespace lumicut
