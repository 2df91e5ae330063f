#include "io/scene_obj.h"

#include <cmath>
#include <ctime>
#include <sstream>

#include "io/image_file.h"
#include "tests/io/temporary_folder.h"

namespace lumicut::io {
namespace {

struct Read : ObjModel {
  std::vector<Texture> textures;
  std::vector<std::string> warnings;
};

Read read(const std::string& path, bool materials = true) {
  Read all;
  TextureStore store(all.textures);
  Warnings warnings;
  static_cast<ObjModel&>(all) = read_obj(path, {.read_materials = materials}, store, warnings);
  all.warnings = warnings.lines();
  return all;
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
  const auto model = read(folder.write("a.obj", "mtllib m.mtl\n" + std::string(kTriangle) + "usemtl red\nf 1 2 3\n"));
  const auto& textures = model.textures;
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
  expect_in(error("f 1 2 4\n"), {"line 4", "vertex index 4 is out of range (3 in the file)"});
  expect_in(error("f 1 2 0\n"), {"line 4", "vertex index 0"});
  expect_in(error("f -4 1 2\n"), {"line 4", "vertex index -4"});
  expect_in(error("f 1 2 99999999999999999999\n"), {"line 4", "out of range"});
  expect_in(error("f 1 2 4294967297\n"), {"line 4", "out of range"});
  expect_in(error("f 1/x 2 3\n"), {"line 4", "'x'"});
  expect_in(error("f 1.5 2 3\n"), {"line 4", "'.'"});
  expect_in(error("f 1/1 2/1 3/1\n"), {"line 4", "texture coordinate index 1"});
  expect_in(error("f 1//1 2//1 3//1\n"), {"line 4", "normal index 1"});
  expect_in(error("f a b c\n"), {"line 4", "'a'"});
  std::string large = "f";
  for (int i = 0; i < 2000; ++i) large += " 1";
  expect_in(error(large + "\n"), {"line 4", "2000 corners", "1024"});
  expect_in(error(""), {"a.obj", "holds no face"});
}

TEST(SceneObj, WrongMaterialsAreNamed) {
  expect_in(mtl_error("newmtl red\nKd nan 0 0\n"), {"m.mtl", "line 2", "\"nan\" of Kd"});
  expect_in(mtl_error("newmtl red\nKd 1 2 x\n"), {"m.mtl", "line 2", "\"x\""});
  expect_in(mtl_error("newmtl red\nKd 0x10 1 1\n"), {"m.mtl", "line 2", "\"0x10\""});
  expect_in(mtl_error("newmtl red\nKd 1 1\n"), {"m.mtl", "line 2", "2 numbers instead of 1 or 3"});
  expect_in(mtl_error("newmtl red\nd -2\n"), {"line 2", "d is -2"});
  expect_in(mtl_error("newmtl red\nNs\n"), {"line 2", "Ns without a number"});
  expect_in(mtl_error("newmtl\n"), {"line 1", "without a name"});
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

TEST(SceneObj, PositionsAloneAreSharedByAllFaces) {
  const TemporaryFolder folder;
  Warnings warnings;
  const Mesh mesh = read_obj_positions(
      folder.write("a.obj",
                   "mtllib none.mtl\n" + std::string(kTriangle) +
                       "v 1 1 0\nvt 0 0\nvt 1 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nusemtl x\nf 2/2 4/2 3/2\nf 1 3 9\nv 0 "
                       "0 1\nv 0 0 2\nv 0 0 3\nv 0 0 4\nv 0 0 5\n"),
      warnings);
  EXPECT_EQ(mesh.indices, (std::vector<uint32_t>{0, 1, 2, 1, 3, 2, 0, 2, 4}));
  EXPECT_EQ(mesh.positions.size(), 15u) << "vertices that no face uses are left out";
  EXPECT_TRUE(mesh.uvs.empty() && mesh.normals.empty());
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

// ---- Untidy files ----

// A triangle of material `red` whose MTL is `mtl`.
Read with_mtl(const TemporaryFolder& folder, const std::string& mtl) {
  folder.write("m.mtl", mtl);
  return read(folder.write("a.obj", "mtllib m.mtl\n" + std::string(kTriangle) + "usemtl red\nf 1 2 3\n"));
}

void expect_one_warning(const Read& model, std::initializer_list<const char*> parts) {
  ASSERT_EQ(model.warnings.size(), 1u) << testing::PrintToString(model.warnings);
  expect_in(model.warnings[0], parts);
}

TEST(UntidyObj, WithoutItsMaterialsAMeshIsGrey) {
  const TemporaryFolder folder;
  const auto model = read(folder.write(
      "a.obj", "mtllib none.mtl\n" + std::string(kTriangle) + "usemtl red\nf 1 2 3\nusemtl red\nf 1 2 3\n"));
  ASSERT_EQ(model.materials.size(), 1u);
  EXPECT_EQ(model.materials[0].name, "red");
  EXPECT_EQ(model.materials[0].values.diffuse[1], 0.5f);
  ASSERT_EQ(model.warnings.size(), 2u) << "a material is named once";
  expect_in(model.warnings[0], {"a.obj: line 1: ", "none.mtl", "does not exist"});
  expect_in(model.warnings[1], {"a.obj: line 5: ", "\"red\"", "in no MTL", "grey"});
}

TEST(UntidyObj, AMissingTextureIsGrey) {
  const TemporaryFolder folder;
  const auto model = with_mtl(folder, "newmtl red\nKd 1 1 1\nmap_Kd no.png\nmap_Ks no.png\nmap_d no.png\n");
  ASSERT_EQ(model.textures.size(), 1u) << "one stands in for all";
  EXPECT_EQ(model.textures[0].floats, (std::vector<float>{0.5f, 0.5f, 0.5f}));
  EXPECT_EQ(model.materials[0].values.diffuse_texture, 1);
  EXPECT_EQ(model.materials[0].values.specular_texture, 1);
  EXPECT_EQ(model.materials[0].values.opacity_texture, 0) << "what has no mask is opaque";
  ASSERT_EQ(model.warnings.size(), 3u);
  expect_in(model.warnings[0], {"m.mtl: line 3: ", "no.png", "material \"red\"", "grey stands in"});
}

TEST(UntidyObj, StatementsOfNoMtlAreTold) {
  const TemporaryFolder folder;
  expect_one_warning(with_mtl(folder, "newmtl red\nKd 1 0 0\nkd 0 1 0\nPr .5\nmap_Bump a.png\n"),
                     {"m.mtl: line 3: ", "\"kd\" is not read"});
  expect_in(error_of([&] { with_mtl(folder, "newmtl red\nKe 1e30 0 0\n"); }), {"m.mtl: line 2: ", "Ke is 1e30"});
}

TEST(UntidyObj, AnEmptyNameOfAMaterialFileAndAFolderAreCalledSo) {
  const TemporaryFolder folder;
  for (const auto& [name, said] : {std::pair{"", "the name of the material file is empty"}, {".", ". is a folder"}}) {
    const auto model = read(folder.write("a.obj", "mtllib " + std::string(name) + "\n" + kTriangle + "f 1 2 3\n"));
    expect_one_warning(model, {"a.obj: line 1: ", said});
  }
}

TEST(UntidyObj, TheLastOfTwoDefinitionsCounts) {
  const TemporaryFolder folder;
  folder.write("n.mtl", "newmtl red\nKd 0 0 1\n");
  const auto again = with_mtl(folder, "newmtl red\nKd 1 0 0\nnewmtl red\nKd 0 1 0\n");
  ASSERT_EQ(again.materials.size(), 1u);
  EXPECT_EQ(again.materials[0].values.diffuse[1], 1.0f);
  expect_one_warning(again, {"m.mtl: line 3: ", "\"red\" is defined again"});
  folder.write("m.mtl", "newmtl red\nKd 1 0 0\n");
  const auto other = read(folder.write(
      "a.obj", "mtllib m.mtl\nmtllib m.mtl\nmtllib n.mtl\n" + std::string(kTriangle) + "usemtl red\nf 1 2 3\n"));
  EXPECT_EQ(other.materials[0].values.diffuse[2], 1.0f);
  expect_one_warning(other, {"n.mtl: line 1: ", "\"red\" is defined again"});
}

TEST(UntidyObj, NamesMayHoldSpacesAndLettersOfAnyKind) {
  const TemporaryFolder folder;
  write_png(folder / "caf\xc3\xa9 au lait.png", {1, 2, 3}, 1, 1, 3);
  folder.write("\xe5\x8d\x97 wall.mtl", "newmtl  brick wall \nKd 1 0 0\nmap_Kd -s 1 1 1 caf\xc3\xa9 au lait.png \n");
  const auto model =
      read(folder.write("r\xc3\xa4ume/../a.obj", "mtllib \xe5\x8d\x97 wall.mtl\t\n" + std::string(kTriangle) +
                                                     "usemtl brick wall\t\nf 1 2 3\n"));
  EXPECT_TRUE(model.warnings.empty()) << testing::PrintToString(model.warnings);
  EXPECT_EQ(model.materials.at(0).values.diffuse_texture, 1);
  EXPECT_EQ(model.textures.at(0).bytes, (std::vector<uint8_t>{1, 2, 3}));
  folder.write("a.mtl", "newmtl a\n"), folder.write("b.mtl", "newmtl b\n");
  EXPECT_EQ(read(folder.write("a.obj", "mtllib a.mtl b.mtl\n" + std::string(kTriangle) + "f 1 2 3\n")).materials.size(),
            3u)
      << "two files in one line, and the material of faces without one";
}

TEST(UntidyObj, AByteOrderMarkIsPassedOver) {
  const TemporaryFolder folder;
  folder.write("m.mtl", "\xef\xbb\xbfnewmtl red\nKd 1 0 0\n");
  const auto model =
      read(folder.write("a.obj", "\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib m.mtl\nusemtl red\nf 1 2 3\n"));
  EXPECT_EQ(model.meshes.at(0).indices.size(), 3u);
  EXPECT_EQ(model.materials.size(), 1u);
  EXPECT_TRUE(model.warnings.empty());
  expect_in(error_of([&] { read(folder.write("b.obj", "\xff\xfev\0 \0")); }), {"b.obj", "UTF-16"});
}

TEST(UntidyObj, ContinuedLinesAreOneAndKeepTheirNumbers) {
  const TemporaryFolder folder;
  folder.write("m.mtl", "newmtl red\nKd \\\n1 0 \\\r\n0.25\nKs x\n");
  for (const char* end : {"\n", "\r\n", "\r"}) {
    std::string text;
    for (const char* line : {"# no line goes on after a comment \\", "v 0 0 \\", "0", "v 1 0 0", "v 0 1 0", "v 1 1 0",
                             "f 1 2 \\", "  4 \\ ", "  3"})
      text += line + std::string(end);
    EXPECT_EQ(read(folder.write("a.obj", text)).meshes.at(0).indices.size(), 6u) << "a quad";
    expect_in(error_of([&] { read(folder.write("a.obj", text + "f 1 2 9" + end)); }), {"line 10", "index 9"});
  }
  expect_in(error_of([&] { with_mtl(folder, "newmtl red\nKd \\\n1 0 \\\r\n0.25\nKs x\n"); }),
            {"line 5", "\"x\" of Ks"});
  EXPECT_EQ(with_mtl(folder, "newmtl red\nKd \\\n1 0 \\\r\n0.25\n").materials[0].values.diffuse[2], 0.25f);
}

TEST(UntidyObj, LinesAndPointsAmongFacesAreNotShown) {
  const TemporaryFolder folder;
  const auto model = read(folder.write(
      "a.obj", std::string(kTriangle) + "l 1 2\np 1\nf 1 2 3\nf 1 2\nf 3\nf\no empty\ng a b\ns off\nusemtl\n"));
  EXPECT_EQ(model.meshes.at(0).indices.size(), 3u);
  ASSERT_EQ(model.warnings.size(), 6u) << testing::PrintToString(model.warnings);
  expect_in(model.warnings[0], {"a.obj: line 4: ", "lines and points"});
  expect_in(model.warnings[4], {"a.obj: line 7: ", "less than three corners"});
}

TEST(UntidyObj, StatementsThatAreNotReadAreTold) {
  const TemporaryFolder folder;
  expect_one_warning(read(folder.write("a.obj", std::string(kTriangle) + "f 1 2 3\ncurv 0 1 1 2\n")),
                     {"a.obj: line 5: ", "\"curv\" is not read"});
  expect_in(error("v\nf 1 2 3\n"), {"line 4", "no numbers"});
}

TEST(UntidyObj, FacesMayStandBeforeTheirVerticesAndMaterials) {
  const TemporaryFolder folder;
  folder.write("m.mtl", "newmtl red\nKd 1 0 0\n");
  const auto model = read(folder.write(
      "a.obj", "usemtl red\nf 1//1 2//1 3//1\nv 9 9 9\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf -1 -2 -3\nmtllib m.mtl\n"));
  ASSERT_EQ(model.meshes.size(), 2u);
  EXPECT_EQ(model.meshes[1].positions[0], 9.0f);
  EXPECT_EQ(model.meshes[1].normals.size(), 9u);
  EXPECT_EQ(model.materials.size(), 1u);
  expect_one_warning(model, {"a.obj: line 2: ", "before its vertices"});
}

TEST(UntidyObj, NegativeReflectancesAreNone) {
  const TemporaryFolder folder;
  const auto model = with_mtl(folder, "newmtl red\nKd 1 0 0\nKs -0.1 0.5 -1\nNs -1\n");
  EXPECT_EQ(model.materials[0].values.specular[0], 0.0f);
  EXPECT_EQ(model.materials[0].values.specular[1], 0.5f);
  EXPECT_EQ(model.materials[0].values.shininess, 0.0f);
  ASSERT_EQ(model.warnings.size(), 3u);
  expect_in(model.warnings[0], {"m.mtl: line 3: ", "Ks is -0.1", "taken as 0"});
}

TEST(UntidyObj, PathsOfOtherMachinesLeadToTheFileBesideTheMtl) {
  const TemporaryFolder folder;
  write_png(folder / "Brick.png", {9, 9, 9}, 1, 1, 3);
  for (const char* name : {"C:\\Users\\me\\maps\\Brick.png", "c:/maps/Brick.png", "/home/me/maps/Brick.png",
                           "C:\\maps\\BRICK.PNG", "\\\\server\\maps\\brick.png"}) {
    const auto model = with_mtl(folder, "newmtl red\nmap_Kd " + std::string(name) + "\n");
    EXPECT_EQ(model.textures.at(0).bytes.size(), 3u) << name;
    expect_one_warning(model, {"m.mtl: line 2: ", "Brick.png is read in its place"});
  }
  const auto missing = with_mtl(folder, "newmtl red\nmap_Kd C:\\maps\\other.png\n");
  expect_one_warning(missing, {"m.mtl: line 2: ", "C:\\maps\\other.png", "does not exist"});
  folder.write("n.mtl", "newmtl red\nKd 1 0 0\n");
  expect_one_warning(
      read(folder.write("a.obj", "mtllib D:\\x\\n.mtl\n" + std::string(kTriangle) + "usemtl red\nf 1 2 3\n")),
      {"a.obj: line 1: ", "n.mtl is read in its place"});
}

TEST(UntidyObj, NamesAreFoundInWrongCase) {
  const TemporaryFolder folder;
  folder.write("Maps/x", "");
  write_png(folder / "Maps/Brick.PNG", {9, 9, 9}, 1, 1, 3);
  folder.write("Room.MTL", "newmtl Red\nKd 1 0 0\nmap_Kd maps\\brick.png\n");
  const auto model =
      read(folder.write("a.obj", "mtllib room.mtl\n" + std::string(kTriangle) + "usemtl red\nf 1 2 3\n"));
  ASSERT_EQ(model.materials.size(), 1u);
  EXPECT_EQ(model.textures.at(0).bytes.size(), 3u);
  ASSERT_EQ(model.warnings.size(), 3u);
  expect_in(model.warnings[0], {"a.obj: line 1: ", "room.mtl", "Room.MTL"});
  expect_in(model.warnings[1], {"Room.MTL: line 3: ", "Brick.PNG"});
  expect_in(model.warnings[2], {"a.obj: line 5: ", "\"red\"", "\"Red\" is taken"});
}

TEST(UntidyObj, WhatRealMtlFilesHoldIsRead) {
  const TemporaryFolder folder;
  write_png(folder / "t.png", {9, 9, 9}, 1, 1, 3);
  const auto model =
      with_mtl(folder,
               "\t# exported\rnewmtl other\rKd 1 1 1\r\r\tnewmtl red  \r  Ka 0 0 0\r\tKs 0.25\r  d -halo 0.5\r"
               "map_Kd -o 0.5 -cc on -mm 0 1 -clamp on t.png\rmap_Bump -bm 1 none.png\rillum 2");
  const auto& red = model.materials.at(1).values;
  EXPECT_EQ(red.specular[2], 0.25f) << "one number stands for three";
  EXPECT_EQ(red.opacity, 0.5f);
  EXPECT_EQ(red.diffuse[0], 1.0f) << "a texture without Kd, whatever material came before";
  EXPECT_EQ(model.textures.at(0).flags & LUMICUT_CLAMP, uint32_t{LUMICUT_CLAMP});
  expect_one_warning(model, {"m.mtl: line 9: ", "-s and -o"});
}

TEST(UntidyObj, WhatRealObjFilesHoldIsRead) {
  const TemporaryFolder folder;
  const auto model =
      read(folder.write("a.obj",
                        "  v  0 0 0 1 0.5 0 \n\tv\t1 0 0 0.1 0.2 0.3\nv 0 1 0 1.0\nvt 0 0 0\nvt 1 0 0\nvn 0 0 1\n"
                        "vp 1\no a\ng\ns 1\nf 1/1/1  2/2/1\t3/1/1 \nf 1//1 2//1 3//1\nf 1/ 2/ 3/"));
  EXPECT_EQ(model.meshes.size(), 2u);
  EXPECT_TRUE(model.warnings.empty()) << testing::PrintToString(model.warnings);
}

TEST(UntidyObj, TenWarningsOfAKindAreToldInFullAndTheRestCounted) {
  const TemporaryFolder folder;
  std::string text = kTriangle;
  for (int i = 0; i < 35; ++i) text += "usemtl m" + std::to_string(i) + "\nf 1 2 3\n";
  const auto model = read(folder.write("a.obj", "mtllib none.mtl\n" + text));
  ASSERT_EQ(model.warnings.size(), 12u);
  EXPECT_EQ(model.warnings.back(), "25 more unknown materials");
}

TEST(SceneObj, ManyTextureCoordinatesOfOneVertexTakeLinearTime) {
  // Work is counted in corners a second against a file whose vertices are all shared: a machine's load cancels out.
  const TemporaryFolder folder;
  const auto seconds = [&](int uvs) {
    std::string text = kTriangle;
    for (int i = 0; i < uvs; ++i) text += "vt 0." + std::to_string(i) + " 0\n";
    for (int i = 0; i < 20000; ++i) {
      const std::string uv = std::to_string(i % uvs + 1);
      text += "f 1/" + uv + " 2/" + uv + " 3/" + uv + "\n";
    }
    const std::string file = folder.write("a.obj", text);
    const std::clock_t begin = std::clock();
    EXPECT_EQ(read(file).meshes.at(0).indices.size(), 60000u);
    return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  };
  const double few = seconds(1);
  EXPECT_LT(seconds(20000), 20 * few + 0.1) << "searching all vertices of a position takes hundreds of times as long";
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
