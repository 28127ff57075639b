#include "core/base/fp_env.hpp"
#include "core/io/checkpoint_layout.hpp"
#include "core/io/hdf5_out.hpp"
#include "core/io/readers.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"

namespace stiction::io {
namespace {

/// Text and integers of 64 bits count in halves, which doubles hold exactly.
class Words {
 public:
  void put(std::uint64_t word) {
    halves_.push_back(static_cast<double>(word >> 32U));
    halves_.push_back(static_cast<double>(word & 0xffffffffU));
  }
  /// Returns their part of the checksum after so many words before them.
  [[nodiscard]] std::uint64_t hash(std::uint64_t before) const {
    return hash_part(std::span<const double>(halves_), 2 * before);
  }

 private:
  std::vector<double> halves_;
};

std::uint64_t words_before_ids(const CheckpointHead& head, std::size_t environments) {
  return head.run.size() + 1 + environments + 1;
}

std::int64_t checksum(const CheckpointFile& checkpoint) {
  const CheckpointHead head{checkpoint.run, checkpoint.step};
  const WorldCheckpoint<double>& world = checkpoint.world;
  CheckpointTotals totals;
  totals.contact_offsets = world.contact_offsets;
  totals.ids = hash_of_ids(head, world.contact_offsets.size() - 1, world.contact_id, 0);
  std::size_t which = 0;
  for_each_reals(world, [&](const char*, const std::vector<double>& values) {
    totals.sizes[which] = values.size();
    totals.hashes[which++] = hash_bits(std::span<const double>(values));
  });
  return checksum_of(head, totals);
}

}  // namespace

std::uint64_t hash_of_ids(const CheckpointHead& head, std::size_t environments, std::span<const std::uint64_t> ids,
                          std::uint64_t first) {
  Words words;
  for (const std::uint64_t id : ids) words.put(id);
  return words.hash(words_before_ids(head, environments) + first);
}

std::int64_t checksum_of(const CheckpointHead& head, const CheckpointTotals& totals) {
  Words begin, end;
  for (const char letter : head.run) begin.put(static_cast<unsigned char>(letter));
  begin.put(static_cast<std::uint64_t>(head.step));
  for (const Offset offset : totals.contact_offsets) begin.put(static_cast<std::uint64_t>(offset));
  for (std::size_t which = 0; which < kCheckpointReals; ++which) {
    end.put(totals.sizes[which]);
    end.put(totals.hashes[which]);
  }
  const std::uint64_t before_ids = words_before_ids(head, totals.contact_offsets.size() - 1);
  const auto ids = static_cast<std::uint64_t>(totals.contact_offsets.back());
  return static_cast<std::int64_t>(begin.hash(0) + totals.ids + end.hash(before_ids + ids));
}

CheckpointHead read_checkpoint_head(const InputFile& file) {
  const std::string format = file.text_attribute("format").value_or("");
  if (format != kCheckpointFormat)
    file.refuse("attribute 'format' is '" + format + "', expected '" + kCheckpointFormat + "'");
  const std::int64_t version = file.integer_attribute("version").value_or(0);
  if (version != kCheckpointVersion)
    file.refuse("attribute 'version' is " + std::to_string(version) + ", expected " +
                std::to_string(kCheckpointVersion));
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

void put_checkpoint_in_place(const std::filesystem::path& written, const std::filesystem::path& path) {
  put_on_disk(written, path);
  remove_parts(path, {});
}

void write_checkpoint(const std::filesystem::path& path, const CheckpointFile& checkpoint) {
  write_checkpoint_part(path, checkpoint);
  remove_parts(path, {});
}

std::int64_t write_checkpoint_part(const std::filesystem::path& part, const CheckpointFile& checkpoint) {
  const ScopedFpEnv fp_env;
  const std::int64_t sum = checksum(checkpoint);
  OutputFile file(part);
  put_attributes(file, {checkpoint.run, checkpoint.step}, sum);
  for_each_reals(checkpoint.world, [&](const char* name, const std::vector<double>& values) {
    file.reals(name, values, checkpoint.precision);
  });
  file.array("contact_id", std::span<const std::uint64_t>(checkpoint.world.contact_id));
  file.array("contact_offsets", checkpoint.world.contact_offsets);
  file.commit_to_disk();
  return sum;
}

}  // namespace stiction::io
