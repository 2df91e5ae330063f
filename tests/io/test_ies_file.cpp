#include "io/ies_file.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tests/io/temporary_folder.h"

namespace lumicut::io {
namespace {

constexpr double kPi = std::numbers::pi;

const char kHead[] = "IESNA:LM-63-2002\n[TEST] none\n[MANUFAC] nobody\n";

IesProfile parse(const std::string& text) {
  Warnings warnings;
  return parse_ies(text, "lamp.ies", warnings);
}
std::string error(const std::string& text) {
  return error_of([&] { parse(text); });
}

TEST(IesFile, AnIsotropicLampHasFourPiLumensACandela) {
  // 100 cd, times 2, times .5 of the ballast.
  const IesProfile p =
      parse(std::string(kHead) + "TILT=NONE\n1 1000 2 3 1 1 2 0 0 0\n0.5 1 60\n0 90 180\n0\n100 100 100\n");
  EXPECT_EQ(p.vertical.size(), 3u);
  EXPECT_EQ(p.horizontal.size(), 1u);
  EXPECT_EQ(p.candela, std::vector<double>(3, 100.0));
  EXPECT_NEAR(p.lumens(), 4 * kPi * 100, 1e-9);
  EXPECT_EQ(p.watts, 60);
}

TEST(IesFile, EveryEditionIsRead) {
  // 1986: no first line, labels alone; numbers may be cut anywhere and commas separate too; CRLF.
  const std::string numbers = "TILT=NONE\r\n1, 1000.,\r\n 1e0 2 1 1 1 -.1 0 0\r\n1.0 1.0 +75\r\n0 90 0 50\r\n0";
  for (const char* first : {"A lamp of ours\r\n", "IESNA91\r\n", "IESNA:LM-63-1995\r\n", "IESNA:LM-63-2002\r\n", ""}) {
    const IesProfile p = parse(first + numbers);
    EXPECT_EQ(p.candela, (std::vector<double>{50, 0}));
    EXPECT_EQ(p.watts, 75);
  }
}

TEST(IesFile, TiltDataIsReadOver) {
  const IesProfile p =
      parse("TILT=INCLUDE\n1\n3\n0 45 90\n0.8 0.9 1\n1 1000 1 2 1 1 2 0 0 0\n1 1 60\n0 90\n0\n100 0\n");
  EXPECT_EQ(p.candela[0], 80) << "the factor at 0 degrees";
}

TEST(IesFile, SymmetryFillsTheWholeCircle) {
  const auto read = [](const std::string& angles, int count) {
    std::string rows;
    for (int i = 0; i < count; ++i) rows += std::to_string(10 * (i + 1)) + " 0\n";
    return parse("TILT=NONE\n1 1000 1 2 " + std::to_string(count) + " 1 2 0 0 0\n1 1 60\n0 90\n" + angles + "\n" +
                 rows);
  };
  const auto column = [](const IesProfile& p) {
    std::vector<double> values;
    for (size_t i = 0; i < p.horizontal.size(); ++i) values.push_back(p.candela[2 * i]);
    return values;
  };
  using V = std::vector<double>;
  const IesProfile quarter = read("0 45 90", 3);
  EXPECT_EQ(quarter.horizontal, (V{0, 45, 90, 135, 180, 225, 270, 315, 360}));
  EXPECT_EQ(column(quarter), (V{10, 20, 30, 20, 10, 20, 30, 20, 10}));
  const IesProfile half = read("0 60 180", 3);
  EXPECT_EQ(half.horizontal, (V{0, 60, 180, 300, 360}));
  EXPECT_EQ(column(half), (V{10, 20, 30, 20, 10}));
  const IesProfile side = read("90 180 270", 3);
  EXPECT_EQ(side.horizontal, (V{0, 90, 180, 270, 360}));
  EXPECT_EQ(column(side), (V{20, 10, 20, 30, 20}));
  const IesProfile whole = read("0 180 360", 3);
  EXPECT_EQ(column(whole), (V{10, 20, 30}));
  const IesProfile without_last = read("0 90 180 270", 4);
  EXPECT_EQ(without_last.horizontal, (V{0, 90, 180, 270, 360}));
  EXPECT_EQ(column(without_last), (V{10, 20, 30, 40, 10}));
}

// Linear between the angles.
double interpolated(const IesProfile& p, double v, double h) {
  const auto place = [](const std::vector<double>& angles, double angle) {
    if (angles.size() == 1) return std::pair<size_t, double>(0, 0);
    const auto above = std::upper_bound(angles.begin() + 1, angles.end() - 1, angle);
    const auto i = static_cast<size_t>(above - angles.begin()) - 1;
    return std::pair<size_t, double>(i, (angle - angles[i]) / (angles[i + 1] - angles[i]));
  };
  const auto [i, s] = place(p.vertical, v);
  const auto [j, t] = place(p.horizontal, h);
  const double* a = &p.candela[j * p.vertical.size() + i];
  const double* b = &p.candela[std::min(j + 1, p.horizontal.size() - 1) * p.vertical.size() + i];
  return std::lerp(std::lerp(a[0], a[1], s), std::lerp(b[0], b[1], s), t);
}

// What people's files look like; those of types A and B are measured from known functions of direction. The add-on's
// reader goes through the same corpus.
TEST(IesFile, TheCorpusIsReadAndRefused) {
  const char* root = std::getenv("LUMICUT_SOURCE_DIR");
  if (!root) GTEST_SKIP() << "LUMICUT_SOURCE_DIR is not set";
  for (const auto& one : nlohmann::json::parse(read_whole_file(std::string(root) + "/tests/io/ies_corpus.json"))) {
    SCOPED_TRACE(one["name"].get<std::string>());
    const auto text = one["text"].get<std::string>();
    if (one.contains("error")) {
      expect_in(error(text), {"lamp.ies", one["error"].get<std::string>().c_str()});
      continue;
    }
    Warnings warnings;
    const IesProfile p = parse_ies(text, "lamp.ies", warnings);
    const double largest = *std::max_element(p.candela.begin(), p.candela.end());
    for (const auto& sample : one["samples"])
      EXPECT_NEAR(interpolated(p, sample[0], sample[1]), sample[2].get<double>(),
                  one["tolerance"].get<double>() * largest)
          << sample;
    EXPECT_EQ(warnings.empty(), one["warnings"].empty());
    for (const auto& words : one["warnings"])
      expect_in(warnings.lines().at(0), {"lamp.ies: line ", words.get<std::string>().c_str()});
  }
}

TEST(IesFile, MalformedFilesAreNamedByLineFieldAndValue) {
  const auto file = [](const std::string& numbers) { return "TILT=NONE\n" + numbers; };
  expect_in(error("no lamp\n"), {"lamp.ies", "TILT="});
  expect_in(error(""), {"lamp.ies", "TILT="});
  expect_in(error("x\nTILT=other.tlt\n"), {"line 2", "other.tlt", "INCLUDE"});
  expect_in(error(file("1 1000 1\n2 1 1 2")), {"line 3", "width of the luminous opening", "ends"});
  expect_in(error(file("1 lots 1 2 1 1 2 0 0 0\n")), {"line 2", "lumens per lamp", "lots", "not a number"});
  expect_in(error(file("1 1 1 2 1 4 2 0 0 0\n")), {"photometric type 4", "[1, 3]"});
  expect_in(error(file("1 1 1 1 1 1 2 0 0 0\n")), {"number of vertical angles 1", "[2, 10000]"});
  expect_in(error(file("1 1 1 2.5 1 1 2 0 0 0\n")), {"number of vertical angles 2.5", "whole"});
  const std::string ten = "1 1 1 2 1 1 2 0 0 0\n1 1 60\n";
  expect_in(error(file(ten + "0 90\n0\n5 -1")), {"line 6", "candela value 2 of horizontal angle 0", "-1"});
  expect_in(error(file(ten + "0 90\n0\n5")), {"candela value 2", "ends"});
  expect_in(error(file(ten + "0 90\n0\n0 0")), {"are 0"});
  expect_in(error(file(ten + "90 0\n0\n5 5")), {"vertical angle 2 0", "does not rise"});
  expect_in(error(file(ten + "10 90\n0\n5 5")), {"start at 10"});
  const std::string two = "1 1 1 2 2 1 2 0 0 0\n1 1 60\n0 90\n";
  expect_in(error(file(two + "0 100\n1 1 1 1")), {"end at 100"});
  expect_in(error(file(two + "10 90\n1 1 1 1")), {"start at 10"});
  expect_in(error(file(ten + "nan 90\n0\n5 5")), {"vertical angle 1", "nan"});
  const TemporaryFolder folder;
  expect_in(error_of([&] {
              Warnings warnings;
              read_ies(folder / "none.ies", warnings);
            }),
            {"none.ies"});
}

}  // namespace
}  // namespace lumicut::io
