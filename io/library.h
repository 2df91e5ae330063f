// The Lumicut library, loaded while the program runs. Nothing here links it. Handles and errors are the wrapper's.
#pragma once

#include <string>

#include "lumicut/lumicut.hpp"

namespace lumicut::io {

using Api = api::Functions;
using LibraryError = api::Exception;
using api::check;
using api::Handle;

class Library {
 public:
  // Opens, in this order: the environment's LUMICUT_LIBRARY; ../lib/liblumicut.so beside this program's folder; the
  // system's liblumicut.so.1. Throws LibraryError when none can be loaded, lacks a function or speaks another major
  // version of the ABI.
  Library();
  ~Library();
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  const Api& api() const { return api_; }
  const std::string& path() const { return path_; }

 private:
  void* handle_ = nullptr;
  std::string path_;
  Api api_;
};

}  // namespace lumicut::io
