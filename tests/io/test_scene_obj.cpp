#include "io/scene_obj.h"

#include <cmath>
#include <sstream>

#include "io/image_file.h"
#include "tests/io/temporary_folder.h"

namespace lumicut::io {
namespace {

ObjModel read(const std::string& path, bool materials = true) {
  std::vector<Texture> textures;
  TextureStore store(textures);
  return read_obj(path, {.read_materials = materials}, store);
}

const char kTriangle[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

// The error of an OBJ of three vertices and `text`.
std::string error(const std::string& text) {
  const TemporaryFolder folder;
  folder.write("m.mtl", "newmtl red\nKd 1 0 0\n");
  return error_of([&] { read(folder.write("a.obj", kTriangle + text)); });
}

std::string mtl_error(const std::string& mtl) {
  const TemporaryFolder folder;
  folder.write("m.mtl", mtl);
  return error_of(
      [&] { read(folder.write("a.obj", "mtllib m.mtl\n" + std::string(kTriangle) + "usemtl red\nf 1 2 3\n")); });
}

TEST(SceneObj, VerticesAreSharedWhereAllIndicesAgree) {
  const TemporaryFolder folder;
  const auto model = read(folder.write("a.obj",
                                       "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 2\n"
                                       "f 1/1/1 2/1/1 3/1/1\nf 1/1/1 3/1/1 4/1/1\nf 1/2/1 3/1/1 4/1/1\n"));
  ASSERT_EQ(model.meshes.size(), 1u);
  const Mesh& mesh = model.meshes[0];
  EXPECT_EQ(mesh.positions.size(), 15u) << "four corners, one of them with a second texture coordinate";
  EXPECT_EQ(mesh.indices, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3, 4, 2, 3}));
  EXPECT_EQ(mesh.uvs[8], 1.0f);
  EXPECT_EQ(mesh.normals[2], 1.0f) << "normals are unit";
}

TEST(SceneObj, NegativeIndicesCountBackwards) {
  const TemporaryFolder folder;
  const auto model = read(folder.write("a.obj", "v 9 9 9\n" + std::string(kTriangle) + "f -3 -2 -1\n"));
  EXPECT_EQ(model.meshes[0].positions, (std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}));
}

TEST(SceneObj, FacesWithoutNormalsBecomeAMeshOfTheirOwn) {
  const TemporaryFolder folder;
  const auto model = read(folder.write(
      "a.obj", std::string(kTriangle) + "vn 0 0 1\nvn 0 0 0\nf 1//1 2//1 3//1\nf 1 2 3\nf 1//1 2//2 3//1\n"));
  ASSERT_EQ(model.meshes.size(), 2u);
  EXPECT_TRUE(model.meshes[0].normals.empty());
  EXPECT_EQ(model.meshes[0].indices.size(), 6u) << "one without, one with a normal of length 0";
  EXPECT_EQ(model.meshes[1].normals.size(), 9u);
}

double area(const std::vector<float>& points, const std::vector<uint32_t>& triangles, double* signed_area) {
  double sum = 0;
  *signed_area = 0;
  for (size_t t = 0; t < triangles.size(); t += 3) {
    const auto p = [&](size_t k, size_t c) { return double{points[triangles[t + k] * 3 + c]}; };
    const double a = 0.5 * ((p(1, 0) - p(0, 0)) * (p(2, 1) - p(0, 1)) - (p(2, 0) - p(0, 0)) * (p(1, 1) - p(0, 1)));
    sum += std::abs(a), *signed_area += a;
  }
  return sum;
}

TEST(SceneObj, ConcavePolygonsAreCutIntoTheirOwnArea) {
  // An L and a star-like zigzag: a fan would cover area outside.
  const std::vector<float> ell = {0, 0, 0, 2, 0, 0, 2, 1, 0, 1, 1, 0, 1, 2, 0, 0, 2, 0};
  double signed_area = 0;
  EXPECT_DOUBLE_EQ(area(ell, triangulate_polygon(ell), &signed_area), 3.0);
  EXPECT_DOUBLE_EQ(signed_area, 3.0) << "and keep their winding";
  const std::vector<float> dart = {0, 0, 0, 4, -1, 0, 1, 0, 0, 4, 1, 0};
  EXPECT_DOUBLE_EQ(area(dart, triangulate_polygon(dart), &signed_area), 1.0);
  std::vector<float> flipped;  // the L clockwise
  for (size_t i = ell.size(); i > 0; i -= 3) flipped.insert(flipped.end(), {ell[i - 3], ell[i - 2], ell[i - 1]});
  area(flipped, triangulate_polygon(flipped), &signed_area);
  EXPECT_DOUBLE_EQ(signed_area, -3.0);
  EXPECT_EQ(triangulate_polygon(std::vector<float>(15, 1.0f)).size(), 9u) << "a polygon without area ends too";
}

TEST(SceneObj, MaterialsAreReadWithTheirLimits) {
  const TemporaryFolder folder;
  folder.write("m.mtl",
               "newmtl red\nKd 1.5 0 0\nKs 0.1 0.2 0.3\nNs 50\nKe 3 4 5\nd 0.25\n\nnewmtl clear\nKd 0 0 0\nillum 7\n");
  const auto model = read(folder.write(
      "a.obj", "mtllib m.mtl\n" + std::string(kTriangle) + "usemtl clear\nf 1 2 3\nusemtl red\nf 1 2 3\n"));
  ASSERT_EQ(model.materials.size(), 2u);
  const auto& red = model.materials[0].values;
  EXPECT_EQ(red.diffuse[0], 1.0f);
  EXPECT_EQ(red.specular[1], 0.2f);
  EXPECT_EQ(red.shininess, 50.0f);
  EXPECT_EQ(red.emission[2], 5.0f);
  EXPECT_EQ(red.opacity, 0.25f);
  EXPECT_EQ(model.materials[1].values.opacity, kHole) << "clear glass lets light pass";
  EXPECT_EQ(model.meshes[0].materials, (std::vector<uint32_t>{1, 0}));
  ASSERT_EQ(model.warnings.size(), 2u);
  expect_in(model.warnings[0], {"red", "cut to 1"});
  expect_in(model.warnings[1], {"clear", "illum 7"});
}

TEST(SceneObj, TexturesBecomeColoursAndMasks) {
  const TemporaryFolder folder;
  write_png(folder / "rgb.png", {255, 0, 0, 0, 255, 0}, 2, 1, 3);
  write_png(folder / "grey.png", {7, 9}, 2, 1, 1);
  folder.write("m.mtl", "newmtl red\nmap_Kd rgb.png\nmap_d .\\grey.png\n\nnewmtl again\nmap_Kd rgb.png\n");
  std::vector<Texture> textures;
  TextureStore store(textures);
  const auto model =
      read_obj(folder.write("a.obj", "mtllib m.mtl\n" + std::string(kTriangle) + "usemtl red\nf 1 2 3\n"), {}, store);
  ASSERT_EQ(textures.size(), 2u) << "a texture is read once";
  const auto& red = model.materials[0].values;
  const Texture& colour = textures[static_cast<size_t>(red.diffuse_texture - 1)];
  EXPECT_EQ(colour.channels, 3u);
  EXPECT_EQ(colour.flags, uint32_t{LUMICUT_SRGB});
  EXPECT_EQ(colour.bytes, (std::vector<uint8_t>{255, 0, 0, 0, 255, 0}));
  const Texture& mask = textures[static_cast<size_t>(red.opacity_texture - 1)];
  EXPECT_EQ(mask.channels, 1u);
  EXPECT_EQ(mask.flags, 0u) << "a mask is linear";
  EXPECT_EQ(model.materials[1].values.diffuse_texture, red.diffuse_texture);
}

TEST(SceneObj, WrongNumbersNameTheLine) {
  expect_in(error("v nan 0 0\n"), {"a.obj", "line 4", "finite", "v nan 0 0"});
  expect_in(error("v 1 2 inf\n"), {"line 4", "inf"});
  expect_in(error("v 1 2\n"), {"line 4", "2 numbers instead of 3"});
  expect_in(error("v 1 0x10 2\n"), {"line 4", "0x10"});
  expect_in(error("v 1e60 0 0\n"), {"line 4", "range"});
  expect_in(error("vn 0 0\n"), {"line 4", "2 numbers instead of 3"});
  expect_in(error("vt\tabc\n"), {"line 4", "finite"});
  expect_in(error("\n# comment\n\nv x 1 2\n"), {"line 7"});
}

TEST(SceneObj, WrongFacesNameTheLineAndTheIndex) {
  expect_in(error("f 1 2 4\n"), {"line 4", "vertex index 4 is out of range (3 so far)"});
  expect_in(error("f 1 2 0\n"), {"line 4", "vertex index 0"});
  expect_in(error("f -4 1 2\n"), {"line 4", "vertex index -4"});
  expect_in(error("f 1 2 99999999999999999999\n"), {"line 4", "out of range"});
  expect_in(error("f 1 2 4294967297\n"), {"line 4", "out of range"});
  expect_in(error("f 1/x 2 3\n"), {"line 4", "'x'"});
  expect_in(error("f 1.5 2 3\n"), {"line 4", "'.'"});
  expect_in(error("f 1/1 2/1 3/1\n"), {"line 4", "texture coordinate index 1"});
  expect_in(error("f 1//1 2//1 3//1\n"), {"line 4", "normal index 1"});
  expect_in(error("f 1 2\n"), {"line 4", "a face of 2 corners"});
  expect_in(error("f a b c\n"), {"line 4", "'a'"});
  std::string large = "f";
  for (int i = 0; i < 2000; ++i) large += " 1";
  expect_in(error(large + "\n"), {"line 4", "2000 corners", "1024"});
  expect_in(error(""), {"a.obj", "holds no face"});
}

TEST(SceneObj, WrongMaterialsAreNamed) {
  expect_in(error("mtllib none.mtl\nf 1 2 3\n"), {"line 4", "none.mtl", "does not exist"});
  expect_in(error("mtllib m.mtl\nusemtl blue\nf 1 2 3\n"), {"line 5", "\"blue\"", "in no MTL"});
  expect_in(mtl_error("newmtl red\nKd nan 0 0\n"), {"m.mtl", "line 2", "\"nan\" of Kd"});
  expect_in(mtl_error("newmtl red\nKd 1 2 x\n"), {"m.mtl", "line 2", "\"x\""});
  expect_in(mtl_error("newmtl red\nKe 1 -2 1\n"), {"line 2", "Ke is -2"});
  expect_in(mtl_error("newmtl red\nNs\n"), {"line 2", "Ns without a number"});
  expect_in(mtl_error("newmtl red\nnewmtl red\n"), {"line 2", "\"red\" stands twice"});
  expect_in(mtl_error("newmtl\n"), {"line 1", "without a name"});
  expect_in(mtl_error("newmtl red\nmap_Kd no.png\n"), {"no.png", "no such texture", "material \"red\"", "m.mtl"});
  expect_in(mtl_error(""), {"line 5", "\"red\"", "in no MTL"});
  const TemporaryFolder folder;
  folder.write("bad.png", "this is not an image");
  folder.write("m.mtl", "newmtl red\nmap_Kd bad.png\n");
  expect_in(error_of([&] { read(folder.write("a.obj", "mtllib m.mtl\n" + std::string(kTriangle) + "f 1 2 3\n")); }),
            {"bad.png", "not readable", "material \"red\""});
}

TEST(SceneObj, WithoutMaterialsNoMtlIsNeeded) {
  const TemporaryFolder folder;
  const auto model =
      read(folder.write("a.obj", "mtllib none.mtl\nusemtl x\n" + std::string(kTriangle) + "f 1 2 3\n"), false);
  EXPECT_TRUE(model.materials.empty());
  EXPECT_EQ(model.meshes[0].materials, (std::vector<uint32_t>{0}));
}

TEST(SceneObj, LineEndsOfAllSystemsAreRead) {
  const TemporaryFolder folder;
  for (const char* end : {"\n", "\r\n", "\r"}) {
    std::string text;
    for (const char* line : {"v 0 0 0", "v 1 0 0", "v 0 1 0", "", "f 1 2 3"}) text += line + std::string(end);
    EXPECT_EQ(read(folder.write("a.obj", text)).meshes[0].indices.size(), 3u);
    expect_in(error_of([&] { read(folder.write("a.obj", text + "f 1 2 9" + end)); }), {"line 6", "index 9"});
    expect_in(error_of([&] { read(folder.write("a.obj", text + "f 1 2 9")); }), {"line 6", "index 9"});
  }
}

TEST(SceneObj, TruncatedAtAnyByteItIsReadOrRefused) {
  const TemporaryFolder folder;
  folder.write("m.mtl", "newmtl red\nKd 1 0 0\n");
  const std::string whole =
      "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\nusemtl red\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -4 "
      "-3 -2\n";
  for (size_t length = 0; length <= whole.size(); ++length) {
    try {
      const auto model = read(folder.write("a.obj", whole.substr(0, length)));
      for (const auto& mesh : model.meshes)
        for (const uint32_t i : mesh.indices) ASSERT_LT(i, mesh.positions.size() / 3);
    } catch (const FileError& error) {
      expect_in(error.what(), {"a.obj"});
    }
  }
}

TEST(SceneObj, RandomBytesNeverCrash) {
  const TemporaryFolder folder;
  folder.write("m.mtl", "newmtl red\nKd 1 0 0\n");
  const std::string whole =
      "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\nusemtl red\nf 1/1/1 2/1/1 3/1/1 4/1/1\nl 1 "
      "2\np 1\n"
      "g a b\no x\ns 1\nt tag 1/1/1 3 4.5 x\nvw 1 2 3\nf -4 -3 -2\n";
  uint32_t state = 7;
  const auto next = [&] { return state = state * 1664525u + 1013904223u, state >> 8; };
  for (int i = 0; i < 500; ++i) {
    std::string broken = whole;
    for (int k = 0; k < 4; ++k) broken[next() % broken.size()] = "0123456789/-. \n\t\\efv#\0\xff"[next() % 24];
    try {
      read(folder.write("a.obj", broken));
    } catch (const FileError&) {
    }
  }
}

}  // namespace
}  // namespace lumicut::io
