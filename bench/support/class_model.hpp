#pragma once

#include <span>

#include "core/job/size_class.hpp"

namespace stiction::bench {

/// Measurement basis of a class of environments, and the least time that a model allows a contact and sweep there. The
/// models are of this method on machines of one kind each; on other machines the ratio to them means nothing.
struct ClassModel {
  SizeClass size_class;
  const char* name;
  const char* scene;  ///< of make_contacts() where the class is dense, else of scenes::make()
  int size;           ///< contacts, or the scene's size
  double cpu;         ///< one Xeon core with AVX-512 [ns per contact and sweep]
  const char* cpu_source;
  double gpu;  ///< one H200, all of its 132 multiprocessors busy [ns per contact and sweep]
  const char* gpu_source;
};

/// The classes in the order of their sizes. CPU: the fastest of several prototypes, timed. GPU: warp-instructions
/// counted in the machine code of prototypes at 1.045e12 a second, or what latency, shared memory or memory allow if
/// that is more.
inline std::span<const ClassModel> class_models() {
  static constexpr const char* kLanes4 = "prototype, a lane each, 4 contacts";
  static constexpr const char* kLanes8 = "prototype, a lane each, 8 contacts";
  static constexpr const char* kFree = "prototype without matrix, a lane each, 64 contacts";
  static constexpr const char* kStream = "A in blocks of 3 x 3, 20 a contact, streamed at 4.3 TB/s";
  static constexpr ClassModel kModels[] = {
      {SizeClass::thread_small, "thread_small", "stack", 4, 1.79, kLanes4, 0.0019, "issue, a thread each, 4 contacts"},
      {SizeClass::thread_medium, "thread_medium", "face", 6, 3.8, kLanes8, 0.0024, "issue, a thread each, 6 contacts"},
      {SizeClass::dense_tile, "dense_tile", "face", 8, 3.8, kLanes8, 0.0065, "issue, 4 lanes each, 8 contacts"},
      {SizeClass::dense_warp, "dense_warp", "face", 22, 7.7, "prototype, a lane each, 22 contacts", 0.060,
       "latency, 32 lanes each, 22 contacts"},
      {SizeClass::dense_block, "dense_block", "face", 32, 19, "prototype, a lane each, 32 contacts", 0.23,
       "latency, a block each, 64 contacts"},
      {SizeClass::dense_large, "dense_large", "face", 64, 33, "prototype, vectors inside one, 64 contacts", 0.54,
       "A of 64 contacts streamed at 4.3 TB/s"},
      {SizeClass::sparse_block, "sparse_block", "pile", 100, 1.9, kFree, 0.20, kStream},
      {SizeClass::sparse_device, "sparse_device", "wall", 20, 1.9, kFree, 0.20, kStream}};
  return kModels;
}

}  // namespace stiction::bench
