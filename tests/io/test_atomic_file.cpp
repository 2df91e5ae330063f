#include "io/atomic_file.h"

#include "tests/io/temporary_folder.h"

namespace lumicut::io {
namespace {

TEST(AtomicFile, AppearsOnlyWhenCommitted) {
  const TemporaryFolder folder;
  {
    AtomicFile file(folder / "a.txt");
    std::ofstream(file.temporary()) << "half";
    EXPECT_FALSE(std::filesystem::exists(folder / "a.txt"));
  }
  EXPECT_EQ(folder.file_count(), 0u) << "nothing is left behind";
  write_whole_file(folder / "a.txt", "whole");
  EXPECT_EQ(read_whole_file(folder / "a.txt"), "whole");
  EXPECT_EQ(folder.file_count(), 1u);
}

TEST(AtomicFile, AFailureLeavesTheOldFile) {
  const TemporaryFolder folder;
  write_whole_file(folder / "a.txt", "old");
  { AtomicFile file(folder / "a.txt"); }
  EXPECT_EQ(read_whole_file(folder / "a.txt"), "old");
}

TEST(AtomicFile, WrongPlacesAreNamed) {
  const TemporaryFolder folder;
  expect_in(error_of([&] { AtomicFile(folder / "no/such/a.txt"); }), {"no/such/a.txt", "does not exist"});
  std::filesystem::create_directory(folder / "sub");
  expect_in(error_of([&] { AtomicFile(folder / "sub"); }), {"sub", "is a folder"});
  expect_in(error_of([&] { read_whole_file(folder / "nothing"); }), {"nothing", "no such file"});
  expect_in(error_of([&] { read_whole_file(folder / "sub"); }), {"sub", "is a folder"});
  folder.write("long", std::string(1000, 'x'));
  expect_in(error_of([&] { read_whole_file(folder / "long", 999); }), {"long", "1000", "999"});
}

}  // namespace
}  // namespace lumicut::io
