#include "distributed/program/whole_checkpoint.hpp"

#include <array>
#include <numeric>
#include <span>
#include <vector>

#include "core/io/checkpoint_layout.hpp"
#include "distributed/program/contact_order.hpp"
#include "distributed/program/shared_file.hpp"
#include "distributed/transport/letters.hpp"
#include "stiction/hash.hpp"

namespace stiction::distributed {

namespace {

/// This rank's range of all contacts.
struct ContactRange {
  std::vector<std::uint64_t> id;
  std::vector<double> impulse;
  std::vector<Offset> offsets{0};  ///< of all ranks' contacts: where each environment's begin
  std::uint64_t first = 0;         ///< contacts of the ranks before
};

ContactRange range_of(Transport& transport, const WorldCheckpoint<double>& own) {
  const std::size_t environments = own.contact_offsets.size() - 1;
  std::vector<EndedContact> known;
  for (std::size_t env = 0; env < environments; ++env)
    for (auto c = static_cast<std::size_t>(own.contact_offsets[env]);
         c < static_cast<std::size_t>(own.contact_offsets[env + 1]); ++c)
      known.push_back({static_cast<std::int64_t>(env),
                       own.contact_id[c],
                       {own.impulse[3 * c], own.impulse[3 * c + 1], own.impulse[3 * c + 2]}});
  ContactRange range;
  std::vector<Offset> counts(environments, 0);
  for (const EndedContact& contact : in_order_of_all(transport, std::move(known))) {
    ++counts[static_cast<std::size_t>(contact.env)];
    range.id.push_back(contact.id);
    range.impulse.insert(range.impulse.end(), contact.impulse, contact.impulse + 3);
  }
  const std::vector<Offset> all = gather_all(transport, std::span<const Offset>(counts));
  for (std::size_t env = 0; env < environments; ++env) {
    Offset count = 0;
    for (std::size_t place = env; place < all.size(); place += environments) count += all[place];
    range.offsets.push_back(range.offsets.back() + count);
  }
  const auto before = static_cast<std::ptrdiff_t>(environments) * transport.rank();
  range.first = static_cast<std::uint64_t>(std::accumulate(all.begin(), all.begin() + before, Offset{0}));
  return range;
}

/// Returns the part of blocks of an array in its hash.
std::uint64_t hash_of(std::span<const double> own, const Slab& slab) {
  std::uint64_t sum = 0;
  for (std::uint64_t k = 0; k < slab.count; ++k)
    sum += hash_part(own.subspan(k * slab.block, slab.block), slab.start + k * slab.stride);
  return sum;
}

void write_reals(SharedFile& file, const char* name, const std::vector<double>& values, const Slab& slab,
                 Precision precision) {
  if (precision == Precision::f64) return file.array(name, std::span<const double>(values), slab);
  std::vector<float> narrow;
  narrow.reserve(values.size());
  for (const double value : values) narrow.push_back(static_cast<float>(value));
  file.array(name, std::span<const float>(narrow), slab);
}

}  // namespace

void write_whole_checkpoint(Transport& transport, const std::filesystem::path& path, const io::CheckpointFile& own,
                            const BodyRange& share, Index bodies) {
  const ContactRange contacts = range_of(transport, own.world);
  const auto number = [](auto value) { return static_cast<std::uint64_t>(value); };
  const std::uint64_t environments = number(own.world.contact_offsets.size() - 1);
  const std::uint64_t all_contacts = number(contacts.offsets.back()), some = number(contacts.id.size());
  const auto of_bodies = [&](std::uint64_t width) {
    return Slab{width * environments * number(bodies), width * number(share.first), width * number(bodies),
                environments, width * number(share.end - share.first)};
  };
  const auto of_contacts = [&](std::uint64_t width) {
    return Slab{width * all_contacts, width * contacts.first, width * some + 1, 1, width * some};
  };
  struct Row {
    const char* name;
    const std::vector<double>* values;
    Slab slab;
  };
  const std::array<Row, io::kCheckpointReals> rows{{{"position", &own.world.position, of_bodies(3)},
                                                    {"orientation", &own.world.orientation, of_bodies(4)},
                                                    {"twist", &own.world.twist, of_bodies(6)},
                                                    {"wrench", &own.world.wrench, of_bodies(6)},
                                                    {"impulse", &contacts.impulse, of_contacts(3)}}};
  const io::CheckpointHead head{own.run, own.step};
  std::array<std::uint64_t, io::kCheckpointReals + 1> hashes{};
  for (std::size_t which = 0; which < rows.size(); ++which)
    hashes[which] = hash_of(*rows[which].values, rows[which].slab);
  hashes.back() = io::hash_of_ids(head, environments, contacts.id, contacts.first);

  io::CheckpointTotals totals;
  totals.contact_offsets = contacts.offsets;
  for (const auto& part : gather(transport, hashes)) {
    for (std::size_t which = 0; which < rows.size(); ++which) totals.hashes[which] += part[which];
    totals.ids += part.back();
  }
  std::uint64_t bytes = 8 * (all_contacts + environments + 1);
  for (std::size_t which = 0; which < rows.size(); ++which) {
    totals.sizes[which] = rows[which].slab.total;
    bytes += rows[which].slab.total * (own.precision == Precision::f64 ? 8 : 4);
  }
  const std::unique_ptr<SharedFile> file = make_shared_file(transport, path, bytes);
  io::put_attributes(*file, head, io::checksum_of(head, totals));
  for (const Row& row : rows) write_reals(*file, row.name, *row.values, row.slab, own.precision);
  file->array("contact_id", std::span<const std::uint64_t>(contacts.id), of_contacts(1));
  const std::uint64_t offsets = transport.rank() == 0 ? environments + 1 : 0;
  file->array("contact_offsets", std::span<const Offset>(contacts.offsets),
              {environments + 1, 0, environments + 1, 1, offsets});
  file->commit();
}

}  // namespace stiction::distributed
