// A host that loads the library while it runs, as Blender and Python do: then the C library makes a thread's variables
// at their first use, and ends the process where there is no memory for them.
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <thread>

#include "failing_memory.h"
#include "lumicut/lumicut.h"

namespace {

TEST(LateLoading, AThreadsFirstErrorNeedsNoMemory) {
  const char* const tree = std::getenv("LUMICUT_BINARY_DIR");
  ASSERT_NE(tree, nullptr);
  void* const library = dlopen((std::string(tree) + "/lib/liblumicut.so").c_str(), RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(library, nullptr) << dlerror();
  const auto cancel = reinterpret_cast<decltype(&lumicut_cancel)>(dlsym(library, "lumicut_cancel"));
  const auto last_error = reinterpret_cast<decltype(&lumicut_last_error)>(dlsym(library, "lumicut_last_error"));
  ASSERT_TRUE(cancel != nullptr && last_error != nullptr);
  lumicut_result result = LUMICUT_OK;
  std::string text, later;
  std::thread([&] {
    const char* now = nullptr;
    failing_memory::arm(0, true);
    {
      const failing_memory::Scope scope;
      result = cancel(nullptr);
      now = last_error();
    }
    failing_memory::disarm();
    text = now;
    cancel(nullptr);
    later = last_error();
  }).join();
  EXPECT_NE(result, LUMICUT_OK);
  EXPECT_NE(text.find("out of memory"), std::string::npos) << text;
  EXPECT_EQ(later, "handle: is NULL");
}

}  // namespace
