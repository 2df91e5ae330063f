#include "io/ies_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>

#include "io/file_error.h"
#include "io/text_lines.h"

namespace lumicut::io {

namespace {

constexpr uint64_t kMaxBytes = uint64_t{16} << 20;
constexpr double kNoise = 0.01;  // of the largest candela value: what a photometer's negative values may be

// Numbers, separated by white space or commas, wherever lines end.
class Numbers {
 public:
  Numbers(const std::string& text, size_t at, int line, const std::string& path, Warnings& warnings)
      : text_(text), at_(at), line_(line), path_(path), warnings_(warnings) {}

  double number(const std::string& field) {
    while (at_ < text_.size() && (std::isspace(static_cast<unsigned char>(text_[at_])) || text_[at_] == ',')) {
      if (text_[at_] == '\n') ++line_;
      ++at_;
    }
    size_t end = at_;
    while (end < text_.size() && !std::isspace(static_cast<unsigned char>(text_[end])) && text_[end] != ',') ++end;
    word_ = text_.substr(at_, end - at_);
    field_ = field;
    if (word_.empty()) throw FileError(path_, fmt::format("line {}: ends where {} should stand", line_, field));
    double value = 0;
    const char* first = word_.data() + (word_[0] == '+' ? 1 : 0);
    const auto [stop, code] = std::from_chars(first, word_.data() + word_.size(), value);
    if (code != std::errc{} || stop != word_.data() + word_.size() || !std::isfinite(value)) fail("is not a number");
    at_ = end;
    return value;
  }
  double number(const std::string& field, double low, double high) {
    const double value = number(field);
    if (!(value >= low && value <= high)) fail(fmt::format("is not in [{}, {}]", low, high));
    return value;
  }
  size_t count(const std::string& field, size_t low, size_t high) {
    const double value = number(field, static_cast<double>(low), static_cast<double>(high));
    if (value != std::floor(value)) fail("is not a whole number");
    return static_cast<size_t>(value);
  }
  // One that scales all intensities: writers have 0 for "none".
  double factor(const std::string& field, double high) {
    const double value = number(field, 0, high);
    if (value == 0) warn("is taken as 1");
    return value == 0 ? 1 : value;
  }
  // Of the number read last.
  [[noreturn]] void fail(const std::string& text) const { throw FileError(path_, remark(text)); }
  void warn(const std::string& text) const { warnings_.add("remarks on IES files", path_, remark(text)); }
  std::string remark(const std::string& text) const {
    return fmt::format("line {}: {} {}: {}", line_, field_, shown(), text);
  }

 private:
  std::string shown() const { return word_.size() > 40 ? word_.substr(0, 40) + "..." : word_; }

  const std::string& text_;
  size_t at_;
  int line_;
  const std::string& path_;
  Warnings& warnings_;
  std::string word_, field_;
};

std::string upper(std::string s) {
  for (char& c : s) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return s;
}

std::vector<double> read_angles(Numbers& in, const char* name, size_t count, double low, double high) {
  std::vector<double> angles;
  for (size_t i = 0; i < count; ++i) {
    angles.push_back(in.number(fmt::format("{} angle {}", name, i + 1), low, high));
    if (i > 0 && !(angles[i] > angles[i - 1])) in.fail(fmt::format("does not rise above {}", angles[i - 1]));
  }
  return angles;
}

// All around, from 0 to 360, from the part that symmetry leaves in the file.
void complete(IesProfile& p, const Numbers& in) {
  std::vector<double>& h = p.horizontal;
  const size_t n = p.vertical.size();
  if (h.size() == 1) {
    if (h[0] != 0) in.warn(fmt::format("the only horizontal angle is {}: the lamp is the same all around", h[0]));
    h[0] = 0;
    return;
  }
  const auto append = [&](double angle, size_t row) {
    h.push_back(angle);
    for (size_t v = 0; v < n; ++v) p.candela.push_back(p.candela[row * n + v]);
  };
  const auto mirror = [&] {
    const double about = h.back();
    for (size_t i = h.size() - 1; i-- > 0;) append(2 * about - h[i], i);
  };
  const double first = h.front(), span = h.back() - first;
  if (std::fmod(first, 90) != 0 && span != 360)
    in.fail(fmt::format("horizontal angles start at {}, but must at a multiple of 90", first));
  if (span == 90)
    mirror(), mirror();
  else if (span == 180)
    mirror();
  else if (span != 360) {
    // Some writers leave the last angle out, which is the first again.
    const double step = h.back() - h[h.size() - 2];
    if (std::abs(360 - span - step) > 1e-6)
      in.fail(fmt::format("horizontal angles end at {}, but must at 0, 90, 180 or 360", h.back()));
    append(first + 360, 0);
  }
  if (h.front() == 0) return;
  // Turned to begin at 0; a row that stands there already is the first, else it lies between its neighbours.
  std::vector<std::pair<double, size_t>> rows;
  for (size_t i = 0; i + 1 < h.size(); ++i) rows.emplace_back(std::fmod(h[i] + 720, 360), i);
  std::sort(rows.begin(), rows.end());
  IesProfile turned;
  const auto add = [&](double angle, size_t a, size_t b, double t) {
    turned.horizontal.push_back(angle);
    for (size_t v = 0; v < n; ++v)
      turned.candela.push_back(t == 0 ? p.candela[a * n + v]
                                      : std::lerp(p.candela[a * n + v], p.candela[b * n + v], t));
  };
  const double before = rows.back().first - 360, after = rows.front().first;
  const auto ends = [&](double angle) {
    add(angle, rows.front().second, rows.back().second, after / (after - before));
  };
  if (after > 0) ends(0);
  for (const auto& [angle, row] : rows) add(angle, row, row, 0);
  ends(360);
  h = std::move(turned.horizontal), p.candela = std::move(turned.candela);
}

// Types A and B: latitude and longitude about an axis across the beam, which is at (0, 0). [CIE 121-1996]
// Type A turns about the axis towards C = 0 of type C, with vertical angles its latitudes; type B about the one towards
// C = 90, with horizontal angles its latitudes. So vertical angles rise towards C = 0, horizontal ones towards C = 90.
void turn_into_type_c(IesProfile& p, bool type_b) {
  const IesProfile from = std::move(p);
  // The place of an angle: interval and share in it. Outside the table there is no light.
  const auto place = [](const std::vector<double>& angles, double angle, size_t& i, double& t) {
    if (angles.front() >= 0) angle = std::abs(angle);  // symmetry leaves one side in the file
    i = 0, t = 0;
    if (angles.size() == 1) return true;
    if (angle < angles.front() - 1e-6 || angle > angles.back() + 1e-6) return false;
    const auto above = std::upper_bound(angles.begin() + 1, angles.end() - 1, angle);
    i = static_cast<size_t>(above - angles.begin()) - 1;
    t = std::clamp((angle - angles[i]) / (angles[i + 1] - angles[i]), 0.0, 1.0);
    return true;
  };
  double finest = 1, widest = 0;
  for (const auto* angles : {&from.vertical, &from.horizontal})
    for (size_t i = 0; i < angles->size(); ++i) {
      widest = std::max(widest, std::abs((*angles)[i]));
      if (i > 0) finest = std::min(finest, (*angles)[i] - (*angles)[i - 1]);
    }
  const int end = widest > 90 ? 180 : 90;
  const int steps = static_cast<int>(std::ceil(end / std::max(finest, 0.25)));
  p = {};
  p.watts = from.watts;
  for (int i = 0; i <= steps; ++i) p.vertical.push_back(static_cast<double>(end) * i / steps);
  for (int c = 0; c <= 360; c += 2) p.horizontal.push_back(c);
  constexpr double kRadian = std::numbers::pi / 180;
  const size_t n = from.vertical.size(), last = from.horizontal.size() - 1;
  for (const double c : p.horizontal)
    for (const double v : p.vertical) {
      const double sine = std::sin(v * kRadian);
      const double up = sine * std::cos(c * kRadian), across = sine * std::sin(c * kRadian), z = std::cos(v * kRadian);
      const auto latitude = [](double x) { return std::asin(std::clamp(x, -1.0, 1.0)) / kRadian; };
      const auto longitude = [&](double x) { return std::hypot(x, z) > 1e-9 ? std::atan2(x, z) / kRadian : 0.0; };
      size_t i = 0, j = 0;
      double s = 0, t = 0, candela = 0;
      if (place(from.vertical, type_b ? longitude(up) : latitude(up), i, s) &&
          place(from.horizontal, type_b ? latitude(across) : longitude(across), j, t)) {
        const auto column = [&](size_t h) {
          const double* values = &from.candela[std::min(h, last) * n];
          return std::lerp(values[i], values[i + 1], s);
        };
        candela = std::lerp(column(j), column(j + 1), t);
      }
      p.candela.push_back(candela);
    }
}

}  // namespace

double IesProfile::lumens() const {
  constexpr double kRadian = std::numbers::pi / 180;
  double sum = 0;
  const size_t n = vertical.size(), columns = horizontal.size() == 1 ? 1 : horizontal.size() - 1;
  for (size_t column = 0; column < columns; ++column) {
    const size_t other = horizontal.size() == 1 ? 0 : column + 1;
    const double width = horizontal.size() == 1 ? 360 : horizontal[other] - horizontal[column];
    for (size_t i = 0; i + 1 < n; ++i) {
      const double a = 0.5 * (candela[column * n + i] + candela[other * n + i]);
      const double b = 0.5 * (candela[column * n + i + 1] + candela[other * n + i + 1]);
      const double t0 = vertical[i] * kRadian, t1 = vertical[i + 1] * kRadian;
      sum +=
          width * kRadian * (a * std::cos(t0) - b * std::cos(t1) + (b - a) / (t1 - t0) * (std::sin(t1) - std::sin(t0)));
    }
  }
  return sum;
}

IesProfile parse_ies(const std::string& raw, const std::string& path, Warnings& warnings) {
  const std::string text = plain_text(raw, path);
  // Labels and keywords up to the line TILT=, whatever they say.
  size_t at = 0;
  int line = 1;
  std::string tilt;
  for (;; ++line) {
    if (at >= text.size()) throw FileError(path, "is no IES file: it has no line that begins with TILT=");
    const size_t end = std::min(text.find('\n', at), text.size());
    std::string content = text.substr(at, std::min<size_t>(end - at, 256));
    std::erase_if(content, [](unsigned char c) { return std::isspace(c) || c == '"'; });
    at = std::min(end + 1, text.size());
    if (upper(content.substr(0, 5)) == "TILT=") {
      tilt = content.substr(5);
      break;
    }
  }
  Numbers in(text, at, line + 1, path, warnings);
  double factor = 1;
  if (upper(tilt) == "INCLUDE") {
    in.count("lamp to luminaire geometry", 1, 3);
    const size_t pairs = in.count("number of tilt angles", 1, 100000);
    std::vector<double> angles;
    for (size_t i = 0; i < pairs; ++i) angles.push_back(in.number(fmt::format("tilt angle {}", i + 1), -360, 360));
    for (size_t i = 0; i < pairs; ++i) {
      const double share = in.number(fmt::format("tilt factor {}", i + 1), 0, 1e6);
      if (angles[i] == 0) factor = share;
    }
  } else if (upper(tilt) != "NONE") {
    throw FileError(path, fmt::format("line {}: TILT={}: only NONE and INCLUDE are read", line, tilt));
  }
  in.number("number of lamps", -1e6, 1e6);
  in.number("lumens per lamp");
  factor *= in.factor("candela multiplier", 1e12);
  const size_t vertical = in.count("number of vertical angles", 2, 10000);
  const size_t horizontal = in.count("number of horizontal angles", 1, 10000);
  const size_t type = in.count("photometric type", 1, 3);
  in.count("units of the luminous opening", 1, 2);
  for (const char* size : {"width", "length", "height"}) in.number(fmt::format("{} of the luminous opening", size));
  factor *= in.factor("ballast factor", 1e6);
  factor *= in.factor("ballast-lamp photometric factor", 1e6);
  IesProfile p;
  p.watts = in.number("input watts", -1, 1e9);
  if (type == 1) {
    p.vertical = read_angles(in, "vertical", vertical, 0, 180);
    if (p.vertical.front() != 0 && p.vertical.front() != 90)
      in.fail(fmt::format("vertical angles start at {}, but must at 0 or 90", p.vertical.front()));
    if (p.vertical.back() != 90 && p.vertical.back() != 180)
      in.warn("there is no light beyond the last vertical angle");
    p.horizontal = read_angles(in, "horizontal", horizontal, -360, 720);
  } else {
    p.vertical = read_angles(in, "vertical", vertical, type == 2 ? -180 : -90, type == 2 ? 180 : 90);
    p.horizontal = read_angles(in, "horizontal", horizontal, type == 2 ? -90 : -180, type == 2 ? 90 : 180);
  }
  double largest = 0, smallest = 0;
  std::string negative;
  for (size_t h = 0; h < horizontal; ++h)
    for (size_t v = 0; v < vertical; ++v) {
      const double candela =
          factor *
          in.number(fmt::format("candela value {} of horizontal angle {}", v + 1, p.horizontal[h]), -1e15, 1e15);
      if (candela < smallest) smallest = candela, negative = in.remark("must not be negative");
      p.candela.push_back(std::max(candela, 0.0));
      largest = std::max(largest, candela);
    }
  if (-smallest > kNoise * largest) throw FileError(path, negative);
  if (smallest < 0) warnings.add("remarks on IES files", path, negative + "; candela values below 0 are taken as 0");
  if (!(largest > 0)) in.fail("all candela values (times multiplier and factors) are 0");
  if (type == 1) {
    complete(p, in);
  } else {
    turn_into_type_c(p, type == 2);
  }
  return p;
}

IesProfile read_ies(const std::string& path, Warnings& warnings) {
  return parse_ies(read_whole_file(path, kMaxBytes), path, warnings);
}

}  // namespace lumicut::io
