#include "geometry/predicates.h"

namespace lumicut {
namespace {

// A sum of doubles that do not overlap, smallest first; exact. [Shewchuk 1997, Grow-Expansion]
struct Expansion {
  double part[16];
  int size = 0;

  void add(double b) {
    double q = b;
    int n = 0;
    for (int i = 0; i < size; ++i) {  // two-sum of q and part[i]
      const double a = part[i], s = q + a, bv = s - q;
      const double err = (q - (s - bv)) + (a - bv);
      if (err != 0.0) part[n++] = err;
      q = s;
    }
    if (q != 0.0) part[n++] = q;
    size = n;
  }
  void add_product(double a, double b) {
    const double p = a * b;
    add(std::fma(a, b, -p));
    add(p);
  }
};

}  // namespace

int orientation_exact(const Point2& a, const Point2& b, const Point2& c) {
  Expansion e;  // a×b + b×c + c×a: twelve parts at most
  e.add_product(a.x, b.y), e.add_product(-a.y, b.x);
  e.add_product(b.x, c.y), e.add_product(-b.y, c.x);
  e.add_product(c.x, a.y), e.add_product(-c.y, a.x);
  if (e.size == 0) return 0;
  return e.part[e.size - 1] > 0 ? 1 : -1;
}

}  // namespace lumicut
