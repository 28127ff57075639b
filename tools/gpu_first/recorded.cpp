#include "tools/gpu_first/recorded.hpp"

#include <cstdint>
#include <fstream>

#include "stiction/error.hpp"

namespace stiction::gpu_first {

namespace {

constexpr char kMagic[] = "stiction recorded batch 1\n";
constexpr std::uint64_t kMost = std::uint64_t{1} << 30;  ///< entries of an array that a file may claim

/// Calls f with every array, in the order of the file.
template <class Arrays, class F>
void for_each_array(Arrays& arrays, F&& f) {
  f(arrays.env_row_offsets);
  f(arrays.env_cone_offsets);
  f(arrays.cone_kind);
  f(arrays.cone_row_offsets);
  f(arrays.cone_group);
  f(arrays.row_offsets);
  f(arrays.column);
  for (auto* const numbers : {&arrays.A, &arrays.b, &arrays.R, &arrays.mu, &arrays.lo, &arrays.hi}) f(*numbers);
}

}  // namespace

std::optional<ContactBatch<float>> read_recorded(const std::string& folder, const std::string& name) {
  const std::string path = folder + "/" + name + ".batch";
  std::ifstream file(path, std::ios::binary);
  if (folder.empty() || !file) return std::nullopt;
  char magic[sizeof kMagic - 1];
  file.read(magic, sizeof magic);
  if (!file || std::string(magic, sizeof magic) != kMagic)
    throw Error(ErrorCode::io, path + " is no recorded batch: make it anew by scripts/pack_for_gpu.sh");
  ContactBatch<float>::Arrays arrays;
  for_each_array(arrays, [&](auto& array) {
    std::uint64_t count = 0;
    file.read(reinterpret_cast<char*>(&count), sizeof count);
    if (!file || count > kMost)
      throw Error(ErrorCode::io, path + " is damaged: make it anew by scripts/pack_for_gpu.sh");
    array.resize(count);
    file.read(reinterpret_cast<char*>(array.data()), static_cast<std::streamsize>(count * sizeof(array[0])));
  });
  if (!file) throw Error(ErrorCode::io, path + " ends early: make it anew by scripts/pack_for_gpu.sh");
  return ContactBatch<float>::from_arrays(Law::convex, std::move(arrays));
}

void write_recorded(const std::string& path, const ContactBatch<float>& batch) {
  std::ofstream file(path, std::ios::binary);
  file.write(kMagic, sizeof kMagic - 1);
  const auto& arrays = batch.arrays();
  for_each_array(arrays, [&](const auto& array) {
    const std::uint64_t count = array.size();
    file.write(reinterpret_cast<const char*>(&count), sizeof count);
    file.write(reinterpret_cast<const char*>(array.data()), static_cast<std::streamsize>(count * sizeof(array[0])));
  });
  if (!file.flush()) throw Error(ErrorCode::io, path + " cannot be written: is there room?");
}

}  // namespace stiction::gpu_first
