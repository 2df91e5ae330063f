#include "io/atomic_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <thread>

#include "tests/io/temporary_folder.h"

namespace lumicut::io {
namespace {

namespace fs = std::filesystem;

mode_t mode_of(const std::string& path) {
  struct stat found {};
  return stat(path.c_str(), &found) == 0 ? found.st_mode & 07777 : 0;
}

TEST(AtomicFile, AppearsWholeAndLeavesNothingBeside) {
  const TemporaryFolder folder;
  write_whole_file(folder / "a.txt", "whole");
  EXPECT_EQ(read_whole_file(folder / "a.txt"), "whole");
  write_whole_file(folder / "a.txt", std::string("other\0text", 10));
  EXPECT_EQ(read_whole_file(folder / "a.txt"), std::string("other\0text", 10));
  EXPECT_EQ(folder.file_count(), 1u);
}

TEST(AtomicFile, CheckingChangesNothing) {
  const TemporaryFolder folder;
  folder.write("a.txt", "old");
  check_writable(folder / "a.txt");
  check_writable(folder / "new.txt");
  EXPECT_EQ(read_whole_file(folder / "a.txt"), "old");
  EXPECT_EQ(folder.file_count(), 1u);
}

TEST(AtomicFile, KeepsTheOldFileWhenTheDiskIsFull) {
  const TemporaryFolder folder;
  folder.write("a.txt", "old");
  {
    const FileLimit limit(1000);
    expect_in(error_of([&] { write_whole_file(folder / "a.txt", std::string(1001, 'x')); }), {"a.txt", "too large"});
    expect_in(error_of([&] { write_whole_file(folder / "b.txt", std::string(1001, 'x')); }), {"b.txt", "too large"});
    write_whole_file(folder / "fits", std::string(1000, 'x'));
  }
  EXPECT_EQ(read_whole_file(folder / "a.txt"), "old");
  EXPECT_EQ(folder.file_count(), 2u) << "a.txt and fits alone";
  expect_in(error_of([&] { write_whole_file("/dev/full", "x"); }), {"/dev/full", "No space left"});
}

TEST(AtomicFile, WritesThroughLinksAndKeepsThem) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "else");
  folder.write("else/a.txt", "old");
  fs::create_symlink("else/a.txt", folder / "one");
  fs::create_symlink("one", folder / "two");
  write_whole_file(folder / "two", "new");
  EXPECT_TRUE(fs::is_symlink(folder / "two"));
  EXPECT_TRUE(fs::is_symlink(folder / "one"));
  EXPECT_EQ(read_whole_file(folder / "else/a.txt"), "new");
  fs::create_symlink("else/new.txt", folder / "dangling");
  check_writable(folder / "dangling");
  EXPECT_FALSE(fs::exists(folder / "else/new.txt"));
  write_whole_file(folder / "dangling", "made");
  EXPECT_EQ(read_whole_file(folder / "else/new.txt"), "made");
  fs::create_symlink("round", folder / "round");
  expect_in(error_of([&] { write_whole_file(folder / "round", "x"); }), {"round", "symbolic links"});
  fs::create_symlink("else", folder / "folder");
  expect_in(error_of([&] { write_whole_file(folder / "folder", "x"); }), {"is a folder"});
}

TEST(AtomicFile, KeepsTheModeAndTakesThatOfNewFilesFromTheMask) {
  const TemporaryFolder folder;
  const mode_t mask = umask(027);
  write_whole_file(folder / "new", "x");
  folder.write("old", "x");
  for (const mode_t mode : {0600u, 0644u, 0666u, 0755u}) {
    chmod((folder / "old").c_str(), mode);
    write_whole_file(folder / "old", "y");
    EXPECT_EQ(mode_of(folder / "old"), mode);
  }
  umask(mask);
  EXPECT_EQ(mode_of(folder / "new"), 0640u);
}

TEST(AtomicFile, KeepsTheOwnerWhereItMay) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can give files away";
  const TemporaryFolder folder;
  folder.write("a", "x");
  ASSERT_EQ(chown((folder / "a").c_str(), 12345, 23456), 0);
  write_whole_file(folder / "a", "y");
  struct stat found {};
  ASSERT_EQ(stat((folder / "a").c_str(), &found), 0);
  EXPECT_EQ(found.st_uid, 12345u);
  EXPECT_EQ(found.st_gid, 23456u);
}

TEST(AtomicFile, FilesWithoutWritePermissionStay) {
  if (geteuid() == 0) GTEST_SKIP() << "root may write everything";
  const TemporaryFolder folder;
  folder.write("a", "x");
  chmod((folder / "a").c_str(), 0444);
  expect_in(error_of([&] { write_whole_file(folder / "a", "y"); }), {"a: cannot be written", "ermission"});
  chmod((folder / ".").c_str(), 0555);
  expect_in(error_of([&] { check_writable(folder / "b"); }), {"b: cannot be written", "ermission"});
  chmod((folder / ".").c_str(), 0755);
}

TEST(AtomicFile, PipesAndDevicesAreWrittenToAndStay) {
  const TemporaryFolder folder;
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  check_writable(folder / "pipe");  // does not wait for a reader
  std::string came;
  std::thread reader([&] { came = read_whole_file(folder / "pipe"); });
  const std::string long_text(300'000, 'x');  // longer than a pipe holds
  write_whole_file(folder / "pipe", long_text);
  reader.join();
  EXPECT_EQ(came, long_text);
  EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
  check_writable("/dev/null");
  write_whole_file("/dev/null", "x");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  fs::create_symlink("/dev/null", folder / "null");
  write_whole_file(folder / "null", "x");
  EXPECT_TRUE(fs::is_symlink(folder / "null"));
  EXPECT_EQ(folder.file_count(), 2u);
}

TEST(AtomicFile, AnOpenDescriptorIsWrittenToWhereItStands) {
  const TemporaryFolder folder;
  const std::string path = folder.write("out", "");
  const int fd = open(path.c_str(), O_WRONLY);
  ASSERT_EQ(write(fd, "first ", 6), 6);
  write_whole_file("/proc/self/fd/" + std::to_string(fd), "second");
  ASSERT_EQ(write(fd, " third", 6), 6);
  close(fd);
  EXPECT_EQ(read_whole_file(path), "first second third");
  const int input = open(path.c_str(), O_RDONLY);
  expect_in(error_of([&] { check_writable("/dev/fd/" + std::to_string(input)); }), {"cannot be written"});
  close(input);
}

TEST(AtomicFile, PlantedLinksAreNotFollowed) {
  const TemporaryFolder folder;
  folder.write("victim", "precious");
  fs::create_directory(folder / "shared");
  for (int i = 0; i < 400; ++i)  // as the name once was
    fs::create_symlink("../victim", folder / ("shared/.a.part" + std::to_string(getpid() + i) + ".txt"));
  fs::create_symlink("../victim", folder / "shared/.lumicut-0000000000000000.part");
  write_whole_file(folder / "shared/a.txt", "new");
  EXPECT_EQ(read_whole_file(folder / "victim"), "precious");
  EXPECT_TRUE(fs::is_symlink(folder / "shared/.lumicut-0000000000000000.part"));
  EXPECT_FALSE(fs::is_symlink(folder / "shared/a.txt"));
}

TEST(AtomicFile, WhatKilledRunsLeftIsRemovedAndWhatOthersWriteIsNot) {
  const TemporaryFolder folder;
  folder.write(".lumicut-0123456789abcdef.part", "half");
  folder.write(".lumicut-0123456789abcdef.part.txt", "another's");
  folder.write("lumicut-x.part", "another's");
  const std::string busy = folder.write(".lumicut-0000000000000001.part", "half");
  const int fd = open(busy.c_str(), O_RDWR);  // as by another run
  ASSERT_EQ(flock(fd, LOCK_EX), 0);
  write_whole_file(folder / "a.txt", "new");
  close(fd);
  EXPECT_FALSE(fs::exists(folder / ".lumicut-0123456789abcdef.part"));
  EXPECT_TRUE(fs::exists(busy));
  EXPECT_EQ(folder.file_count(), 4u);
}

TEST(AtomicFile, AnyNameWillDo) {
  const TemporaryFolder folder;
  for (const std::string& name :
       {std::string(255, 'n'), std::string("Übermaß 灯 'a\" %s\n.exr"), std::string("\xff\xfe")}) {
    check_writable(folder / name);
    write_whole_file(folder / name, name);
    EXPECT_EQ(read_whole_file(folder / name), name);
  }
  expect_in(error_of([&] { check_writable(folder / std::string(256, 'n')); }), {"too long"});
}

TEST(AtomicFile, WrongPlacesAreNamed) {
  const TemporaryFolder folder;
  expect_in(error_of([&] { check_writable(folder / "no/such/a.txt"); }), {"no/such/a.txt", "does not exist"});
  fs::create_directory(folder / "sub");
  expect_in(error_of([&] { check_writable(folder / "sub"); }), {"sub", "is a folder"});
  expect_in(error_of([&] { check_writable(folder / "sub/new/"); }), {"sub/new/", "no file name"});
  expect_in(error_of([&] { check_writable(""); }), {"no file name"});
}

TEST(ReadFile, WrongPlacesAreNamed) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "sub");
  expect_in(error_of([&] { read_whole_file(folder / "nothing"); }), {"nothing", "no such file"});
  expect_in(error_of([&] { read_whole_file(folder / "sub"); }), {"sub", "is a folder"});
  folder.write("long", std::string(1000, 'x'));
  expect_in(error_of([&] { read_whole_file(folder / "long", 999); }), {"long", "1000", "999"});
}

TEST(ReadFile, DevicesAndEndlessFilesAreRefused) {
  const TemporaryFolder folder;
  for (const char* device : {"/dev/zero", "/dev/null", "/dev/tty"}) {
    expect_in(error_of([&] { read_whole_file(device); }), {device, "is a device"});
    expect_in(error_of([&] { check_regular_file(device); }), {device, "is a device"});
  }
  const std::string sparse = folder.write("sparse", "");
  fs::resize_file(sparse, uint64_t{1} << 42);
  expect_in(error_of([&] { read_whole_file(sparse, uint64_t{1} << 60); }), {"sparse", "too many"});
}

TEST(ReadFile, APipeIsReadWhileItsWriterLives) {
  const TemporaryFolder folder;
  const std::string pipe = folder / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  expect_in(error_of([&] { check_regular_file(pipe); }), {"is a pipe"});
  std::thread writer([&] {
    const int fd = open(pipe.c_str(), O_WRONLY);
    for (int i = 0; i < 3; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      EXPECT_EQ(write(fd, "part ", 5), 5);
    }
    close(fd);
  });
  EXPECT_EQ(read_whole_file(pipe), "part part part ");
  writer.join();
  expect_in(error_of([&] { read_whole_file(pipe); }), {"pipe", "nobody writes"});
  std::thread second([&] { write_whole_file(pipe, std::string(100'000, 'x')); });
  const int held = open(pipe.c_str(), O_RDONLY);  // so that the writer does not end by SIGPIPE
  expect_in(error_of([&] { read_whole_file(pipe, 70'000); }), {"pipe", "longer than 70000"});
  for (char chunk[4096]; read(held, chunk, sizeof chunk) > 0;) {
  }
  close(held);
  second.join();
}

}  // namespace
}  // namespace lumicut::io
