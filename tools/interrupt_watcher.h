// Turns Ctrl-C into lumicut_cancel of the object that works now. The handler itself may only set a flag.
#pragma once

#include <atomic>
#include <chrono>
#include <thread>

#include "io/library.h"
#include "tools/commands.h"

namespace lumicut::tools {

class InterruptWatcher {
 public:
  explicit InterruptWatcher(const io::Api& api)
      : thread_([this, &api] {
          while (!done_) {
            if (void* handle = interrupted ? handle_.load() : nullptr) api.cancel(handle);
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
          }
        }) {}
  ~InterruptWatcher() {
    done_ = true;
    thread_.join();
  }
  void watch(void* handle) { handle_ = handle; }

 private:
  std::atomic<void*> handle_{nullptr};
  std::atomic<bool> done_{false};
  std::thread thread_;
};

}  // namespace lumicut::tools
