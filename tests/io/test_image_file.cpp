#include "io/image_file.h"

#include <sys/resource.h>

#include <cmath>

#include "tests/io/temporary_folder.h"

namespace lumicut::io {
namespace {

ImageLayer layer(const std::string& name, int components, int pixels, float start) {
  ImageLayer l{name, components, {}};
  for (int i = 0; i < pixels * components; ++i) l.pixels.push_back(start + 0.37f * static_cast<float>(i));
  return l;
}

Image example() {
  Image image;
  image.width = 5, image.height = 3;
  image.layers = {layer("radiance", 3, 15, 0.1f), layer("depth", 1, 15, 7),      layer("normal", 3, 15, -1),
                  layer("albedo", 3, 15, 0),      layer("cut_size", 1, 15, 100), layer("alpha", 1, 15, 0)};
  image.attributes = {{"seed", "7"}, {"parameters", "{\"error\": \"0.02\"}"}};
  return image;
}

TEST(ImageFile, LayersAndAttributesComeBack) {
  const TemporaryFolder folder;
  const Image image = example();
  write_exr(folder / "a.exr", image, false);
  const Image back = read_image(folder / "a.exr");
  EXPECT_EQ(back.width, 5);
  EXPECT_EQ(back.height, 3);
  EXPECT_EQ(back.attributes, image.attributes);
  ASSERT_EQ(back.layers.size(), image.layers.size());
  for (const auto& l : image.layers) {
    const ImageLayer* found = back.find(l.name);
    ASSERT_NE(found, nullptr) << l.name;
    EXPECT_EQ(found->components, l.components);
    EXPECT_EQ(found->pixels, l.pixels) << l.name;
  }
  EXPECT_EQ(folder.file_count(), 1u);
}

TEST(ImageFile, HalfFloatsAreRoundedAndCut) {
  const TemporaryFolder folder;
  Image image;
  image.width = image.height = 1;
  image.layers = {{"radiance", 3, {1e9f, 0.1f, -2}}};
  write_exr(folder / "a.exr", image, true);
  const auto back = read_image(folder / "a.exr").layers.at(0).pixels;
  EXPECT_EQ(back[0], 65504.0f);
  EXPECT_NEAR(back[1], 0.1f, 0.1f / 2048);
  EXPECT_EQ(back[2], -2.0f);
}

TEST(ImageFile, ACropKeepsItsPlace) {
  const TemporaryFolder folder;
  Image image = example();
  image.x0 = 10, image.y0 = 20, image.frame_width = 64, image.frame_height = 48;
  write_exr(folder / "a.exr", image, false);
  const Image back = read_image(folder / "a.exr");
  EXPECT_EQ(back.x0, 10);
  EXPECT_EQ(back.y0, 20);
  EXPECT_EQ(back.frame_width, 64);
  EXPECT_EQ(back.width, 5);
  EXPECT_EQ(back.find("radiance")->pixels, image.layers[0].pixels);
}

TEST(ImageFile, BrokenImagesAreErrors) {
  const TemporaryFolder folder;
  expect_in(error_of([&] { read_image(folder / "none.exr"); }), {"none.exr", "no such file"});
  expect_in(error_of([&] { read_image(folder.write("text.exr", "not an image")); }),
            {"text.exr", "not readable as an image"});
  write_exr(folder / "a.exr", example(), false);
  const std::string whole = read_whole_file(folder / "a.exr");
  for (const size_t length : {size_t{0}, size_t{4}, size_t{100}, whole.size() / 2, whole.size() - 10})
    expect_in(error_of([&] { read_image(folder.write("cut.exr", whole.substr(0, length))); }),
              {"cut.exr", "not readable"});
}

TEST(ImageFile, AnAttributeLongerThanItsFileIsRefusedBeforeMemoryIsTaken) {
  const TemporaryFolder folder;
  write_exr(folder / "a.exr", example(), false);
  std::string bytes = read_whole_file(folder / "a.exr");
  const size_t type = bytes.find(std::string("\0string\0", 8));
  ASSERT_NE(type, std::string::npos);
  bytes.replace(type + 8, 4, "\x01\x02\x03\x61");  // 1.6 GB
  rusage before{}, after{};
  getrusage(RUSAGE_SELF, &before);
  expect_in(error_of([&] { read_image(folder.write("b.exr", bytes)); }), {"b.exr", "claims 1627587073 bytes"});
  getrusage(RUSAGE_SELF, &after);
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 100 << 10);  // kB; OpenEXR alone takes all of them
}

TEST(ImageFile, APngsChunkLongerThanItsFileIsRefusedBeforeMemoryIsTaken) {
  const TemporaryFolder folder;
  write_png(folder / "a.png", std::vector<uint8_t>(3 * 4 * 3, 128), 4, 3, 3);
  std::string bytes = read_whole_file(folder / "a.png");
  const size_t end = bytes.find("IEND");
  ASSERT_NE(end, std::string::npos);
  for (const size_t at : {size_t{33}, end - 4}) {  // after the header, and after the pixels
    std::string longer = bytes;
    longer.insert(at, std::string("\x71\0\0\0tEXt", 8));  // 1.9 GB
    rusage before{}, after{};
    getrusage(RUSAGE_SELF, &before);
    expect_in(error_of([&] { read_image(folder.write("b.png", longer)); }), {"b.png", "claims 1895825408 bytes"});
    getrusage(RUSAGE_SELF, &after);
    EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 100 * 1024);
  }
}

TEST(ImageFile, BytesTurnedOverNeverCrash) {
  const TemporaryFolder folder;
  write_exr(folder / "a.exr", example(), false);
  const std::string whole = read_whole_file(folder / "a.exr");
  uint32_t state = 1;
  for (int i = 0; i < 100; ++i) {
    std::string broken = whole;
    for (int k = 0; k < 3; ++k) {
      state = state * 1664525u + 1013904223u;
      broken[state % broken.size()] = static_cast<char>(state >> 24);
    }
    try {
      read_image(folder.write("b.exr", broken));
    } catch (const FileError&) {  // either is right; a crash is not
    }
  }
}

TEST(ImageFile, WritingToAWrongPlaceLeavesNothing) {
  const TemporaryFolder folder;
  expect_in(error_of([&] { write_exr(folder / "no/a.exr", example(), false); }), {"no/a.exr", "does not exist"});
  expect_in(error_of([&] { write_exr(folder / "a.exr", Image{}, false); }), {"0 x 0"});
  Image wrong = example();
  wrong.layers[0].pixels.pop_back();
  expect_in(error_of([&] { write_exr(folder / "a.exr", wrong, false); }), {"radiance", "44", "45"});
  expect_in(error_of([&] { write_png(folder / "a.png", {1, 2, 3}, 2, 1, 3); }), {"a.png", "3 values"});
  EXPECT_EQ(folder.file_count(), 0u);
}

TEST(ImageFile, KeepsTheOldImageWhenTheDiskIsFull) {
  const TemporaryFolder folder;
  write_exr(folder / "whole.exr", example(), false);
  const size_t size = read_whole_file(folder / "whole.exr").size();
  folder.write("a.exr", "old");
  // Offsets of the rows are written last, over zeros that stand there already.
  for (const size_t missing : {size_t{1}, size_t{100}, size / 2, size}) {
    const FileLimit limit(size - missing);
    expect_in(error_of([&] { write_exr(folder / "a.exr", example(), false); }), {"a.exr", "cannot be written"});
  }
  EXPECT_EQ(read_whole_file(folder / "a.exr"), "old");
  EXPECT_EQ(folder.file_count(), 2u);
}

TEST(ImageFile, PngStartsAsPngsDo) {
  const TemporaryFolder folder;
  write_png(folder / "a.png", {255, 0, 0, 0, 255, 0}, 2, 1, 3);
  EXPECT_EQ(read_whole_file(folder / "a.png").substr(0, 4), "\x89PNG");
}

}  // namespace
}  // namespace lumicut::io
