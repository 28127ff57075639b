#include "core/base/fp_env.hpp"
#include "core/io/hdf5_out.hpp"
#include "core/io/readers.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"

namespace stiction::io {
namespace {

constexpr const char* kFormat = "world-checkpoint";
constexpr std::int64_t kVersion = 1;

/// f(name, numbers), for every array of a world.
template <class World, class F>
void for_each_reals(World& world, F&& f) {
  f("position", world.position);
  f("orientation", world.orientation);
  f("twist", world.twist);
  f("wrench", world.wrench);
  f("impulse", world.impulse);
}

/// Of all that a file holds. A text's bytes and integers of 64 bits count in halves, which doubles hold exactly.
std::int64_t checksum(const CheckpointFile& checkpoint) {
  std::vector<double> words;
  const auto put = [&](std::uint64_t word) {
    words.push_back(static_cast<double>(word >> 32U));
    words.push_back(static_cast<double>(word & 0xffffffffU));
  };
  for (const char letter : checkpoint.run) put(static_cast<unsigned char>(letter));
  put(static_cast<std::uint64_t>(checkpoint.step));
  for (const Offset offset : checkpoint.world.contact_offsets) put(static_cast<std::uint64_t>(offset));
  for (const std::uint64_t id : checkpoint.world.contact_id) put(id);
  for_each_reals(checkpoint.world, [&](const char*, const std::vector<double>& values) {
    put(values.size());
    put(hash_bits(std::span<const double>(values)));
  });
  return static_cast<std::int64_t>(hash_bits(std::span<const double>(words)));
}

}  // namespace

CheckpointHead read_checkpoint_head(const InputFile& file) {
  const std::string format = file.text_attribute("format").value_or("");
  if (format != kFormat) file.refuse("attribute 'format' is '" + format + "', expected '" + kFormat + "'");
  const std::int64_t version = file.integer_attribute("version").value_or(0);
  if (version != kVersion)
    file.refuse("attribute 'version' is " + std::to_string(version) + ", expected " + std::to_string(kVersion));
  CheckpointHead head;
  head.run = file.text_attribute("run").value_or("");
  head.step = file.integer_attribute("step").value_or(-1);
  if (head.step < 0) file.refuse("attribute 'step' is missing or negative");
  return head;
}

CheckpointFile read_checkpoint(const InputFile& file) {
  const CheckpointHead head = read_checkpoint_head(file);
  CheckpointFile checkpoint;
  checkpoint.run = head.run;
  checkpoint.step = head.step;
  checkpoint.precision = file.is_single("position") ? Precision::f32 : Precision::f64;
  WorldCheckpoint<double>& world = checkpoint.world;
  for_each_reals(world, [&](const char* name, std::vector<double>& values) { values = file.reals(name); });
  world.contact_id = file.bits("contact_id");
  world.contact_offsets = file.integers<Offset>("contact_offsets");
  check_offsets(file, "contact_offsets", world.contact_offsets, world.contact_id.size());
  if (file.integer_attribute("checksum") != checksum(checkpoint))
    file.refuse("is damaged: what it holds does not have the checksum that it was written with");
  return checkpoint;
}

std::int64_t checksum_of(const InputFile& file) {
  return file.integer_attribute("checksum").value_or(0);
}

void write_checkpoint(const std::filesystem::path& path, const CheckpointFile& checkpoint) {
  write_checkpoint_part(path, checkpoint);
  remove_parts(path, {});
}

std::int64_t write_checkpoint_part(const std::filesystem::path& part, const CheckpointFile& checkpoint) {
  const ScopedFpEnv fp_env;
  const std::int64_t sum = checksum(checkpoint);
  OutputFile file(part);
  file.attribute("format", kFormat);
  file.attribute("version", kVersion);
  file.attribute("numerics_epoch", std::int64_t{kNumericsEpoch});
  file.attribute("run", checkpoint.run);
  file.attribute("step", checkpoint.step);
  file.attribute("checksum", sum);
  for_each_reals(checkpoint.world, [&](const char* name, const std::vector<double>& values) {
    file.reals(name, values, checkpoint.precision);
  });
  file.array("contact_id", std::span<const std::uint64_t>(checkpoint.world.contact_id));
  file.array("contact_offsets", checkpoint.world.contact_offsets);
  file.commit_to_disk();
  return sum;
}

}  // namespace stiction::io
