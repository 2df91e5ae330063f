#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <sstream>

#include "core/error.h"
#include "geometry/csv.h"
#include "geometry/mesh_file.h"

namespace lumicut {
namespace {

template <typename Fn>
std::string message_of(Fn&& fn) {
  try {
    fn();
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

TEST(Csv, ReadsHeadingsCommentsAndBlanks) {
  std::istringstream points("x,y\n1,2\n\n# nothing\n -3.5 , +4e-1 \r\n");
  const auto p = read_points_csv(points, "p.csv");
  ASSERT_EQ(p.size(), 2u);
  EXPECT_EQ(p[1], (Point2{-3.5, 0.4}));
  std::istringstream disks("1,2,3\n");
  const auto d = read_disks_csv(disks, "d.csv");
  ASSERT_EQ(d.size(), 1u);
  EXPECT_EQ(d[0].radius, 3.0);
  std::istringstream none("");
  EXPECT_TRUE(read_points_csv(none, "n").empty());
}

TEST(Csv, NamesTheLineAndTheFieldOfWhatIsWrong) {
  const auto read = [](const char* text) {
    return message_of([&] {
      std::istringstream in(text);
      read_disks_csv(in, "d.csv");
    });
  };
  EXPECT_NE(read("1,2,3\n1,nan,3\n").find("line 2: y is nan"), std::string::npos);
  EXPECT_NE(read("1,2,inf\n").find("radius is inf"), std::string::npos);
  EXPECT_NE(read("1,2,3\n1,2,-3\n").find("line 2: radius is -3, below 0"), std::string::npos);
  EXPECT_NE(read("1,2\n").find("line 1: radius is missing"), std::string::npos);
  EXPECT_NE(read("1,2,3,4\n").find("more than 3 fields"), std::string::npos);
  EXPECT_NE(read("1,2,3\nx,y,r\n").find("line 2: x is missing or not a number"), std::string::npos);
}

TEST(FaceMesh, IsMadeOfAReadersArrays) {
  const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::vector<uint32_t> indices = {0, 1, 2, 2, 1, 0};
  const FaceMesh m = make_face_mesh(positions, indices);
  ASSERT_EQ(m.vertices.size(), 3u);
  EXPECT_EQ(m.vertices[1].x, 1.0);
  EXPECT_EQ(m.faces, (std::vector<std::array<uint32_t, 3>>{{0, 1, 2}, {2, 1, 0}}));
}

TEST(PlyMesh, HasTheSizeThatItsHeaderSays) {
  FaceMesh m;
  m.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  m.faces = {{0, 1, 2}};
  const std::array<uint8_t, 3> red[] = {{255, 0, 0}};
  const std::string all = ply_of(m, red);
  const size_t body = all.find("end_header\n") + 11;
  EXPECT_EQ(all.size() - body, 3u * 12 + 16);
  EXPECT_NE(all.find("element face 1\n"), std::string::npos);
  EXPECT_THROW(ply_of(m, {}), Error);
}

}  // namespace
}  // namespace lumicut
