#include "io/ies_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>

#include "io/file_error.h"

namespace lumicut::io {

namespace {

constexpr uint64_t kMaxBytes = uint64_t{16} << 20;

// Numbers, separated by white space or commas, wherever lines end.
class Numbers {
 public:
  Numbers(const std::string& text, size_t at, size_t line, const std::string& path)
      : text_(text), at_(at), line_(line), path_(path) {}

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
  // Of the number read last.
  [[noreturn]] void fail(const std::string& text) const {
    throw FileError(path_, fmt::format("line {}: {} {}: {}", line_, field_, shown(), text));
  }

 private:
  std::string shown() const { return word_.size() > 40 ? word_.substr(0, 40) + "..." : word_; }

  const std::string& text_;
  size_t at_, line_;
  const std::string& path_;
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

// All around from the part that symmetry leaves in the file.
void complete(IesProfile& p, const Numbers& in) {
  std::vector<double>& h = p.horizontal;
  const size_t n = p.vertical.size();
  const double first = h.front(), last = h.back();
  if (h.size() == 1) {
    if (first != 0) in.fail(fmt::format("the only horizontal angle is {}, but must be 0", first));
    return;
  }
  const auto row = [&](size_t i) {
    return std::vector<double>(p.candela.begin() + static_cast<std::ptrdiff_t>(i * n),
                               p.candela.begin() + static_cast<std::ptrdiff_t>((i + 1) * n));
  };
  const auto append = [&](double angle, const std::vector<double>& values) {
    h.push_back(angle);
    p.candela.insert(p.candela.end(), values.begin(), values.end());
  };
  const auto mirror = [&](double about) {
    for (size_t i = h.size() - 1; i-- > 0;) append(2 * about - h[i], row(i));
  };
  if (first == 90 && last == 270) {  // mirrored about the plane through 90 and 270
    IesProfile whole;
    for (size_t i = h.size(); i-- > 0;)
      if (h[i] <= 180) {
        whole.horizontal.push_back(180 - h[i]);
        const auto values = row(i);
        whole.candela.insert(whole.candela.end(), values.begin(), values.end());
      }
    const auto add = [&](double angle, size_t i) {
      if (!(angle > whole.horizontal.back())) return;
      whole.horizontal.push_back(angle);
      const auto values = row(i);
      whole.candela.insert(whole.candela.end(), values.begin(), values.end());
    };
    for (size_t i = 0; i < h.size(); ++i) add(h[i], i);
    for (size_t i = h.size(); i-- > 0;)
      if (h[i] >= 180) add(540 - h[i], i);
    if (whole.horizontal.front() != 0) in.fail("horizontal angles from 90 to 270 must hold 180");
    h = whole.horizontal, p.candela = whole.candela;
    return;
  }
  if (first != 0) in.fail(fmt::format("horizontal angles start at {}, but must at 0, or go from 90 to 270", first));
  if (last == 90)
    mirror(90), mirror(180);
  else if (last == 180)
    mirror(180);
  else if (last != 360) {
    // Some writers leave the last angle out, which is the first again.
    const double step = h.back() - h[h.size() - 2];
    if (std::abs(360 - last - step) > 1e-6)
      in.fail(fmt::format("horizontal angles end at {}, but must at 0, 90, 180 or 360", last));
    append(360, row(0));
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

IesProfile parse_ies(const std::string& text, const std::string& path) {
  // Labels and keywords up to the line TILT=, whatever they say.
  size_t at = 0, line = 1;
  std::string tilt;
  for (;; ++line) {
    if (at >= text.size()) throw FileError(path, "is no IES file: it has no line that begins with TILT=");
    const size_t end = std::min(text.find('\n', at), text.size());
    std::string content = text.substr(at, end - at);
    while (!content.empty() && std::isspace(static_cast<unsigned char>(content.back()))) content.pop_back();
    at = std::min(end + 1, text.size());
    if (upper(content.substr(0, 5)) == "TILT=") {
      tilt = content.substr(5);
      break;
    }
  }
  Numbers in(text, at, line + 1, path);
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
  in.number("number of lamps", 0, 1e6);
  in.number("lumens per lamp");
  factor *= in.number("candela multiplier", 0, 1e12);
  const size_t vertical = in.count("number of vertical angles", 2, 10000);
  const size_t horizontal = in.count("number of horizontal angles", 1, 10000);
  const size_t type = in.count("photometric type", 1, 3);
  if (type != 1) in.fail(fmt::format("type {} photometry is not read, only type C (1)", type == 2 ? "B" : "A"));
  in.count("units of the luminous opening", 1, 2);
  for (const char* size : {"width", "length", "height"}) in.number(fmt::format("{} of the luminous opening", size));
  factor *= in.number("ballast factor", 0, 1e6);
  factor *= in.number("ballast-lamp photometric factor", 0, 1e6);
  IesProfile p;
  p.watts = in.number("input watts", 0, 1e9);
  p.vertical = read_angles(in, "vertical", vertical, 0, 180);
  if (p.vertical.front() != 0 && p.vertical.front() != 90)
    in.fail(fmt::format("vertical angles start at {}, but must at 0 or 90", p.vertical.front()));
  if (p.vertical.back() != 90 && p.vertical.back() != 180)
    in.fail(fmt::format("vertical angles end at {}, but must at 90 or 180", p.vertical.back()));
  p.horizontal = read_angles(in, "horizontal", horizontal, 0, 360);
  double largest = 0;
  for (size_t h = 0; h < horizontal; ++h)
    for (size_t v = 0; v < vertical; ++v) {
      const double candela =
          factor * in.number(fmt::format("candela value {} of horizontal angle {}", v + 1, p.horizontal[h]), 0, 1e15);
      p.candela.push_back(candela);
      largest = std::max(largest, candela);
    }
  if (!(largest > 0)) in.fail("all candela values (times multiplier and factors) are 0");
  complete(p, in);
  return p;
}

IesProfile read_ies(const std::string& path) { return parse_ies(read_whole_file(path, kMaxBytes), path); }

}  // namespace lumicut::io
