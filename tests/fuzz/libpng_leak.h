// For targets that read PNG: OpenImageIO 2.4's reader keeps an error's text in a string when libpng's longjmp leaves its
// callback. Allocations are traced through libraries without frame pointers, and the library is named, which needs no
// symbolizer. Where no frame beyond the string's own is found, that one is named: a string of ours that leaked so would leak
// with what holds it, which is reported.
#pragma once

extern "C" [[gnu::used]] inline const char* __asan_default_options() { return "fast_unwind_on_malloc=0"; }
extern "C" [[gnu::used]] inline const char* __lsan_default_suppressions() { return "leak:libpng16\nleak:_M_assign\n"; }
