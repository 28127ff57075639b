#include <algorithm>
#include <limits>
#include <optional>

#include "core/base/fp_env.hpp"
#include "core/io/hdf5_out.hpp"
#include "core/io/readers.hpp"
#include "stiction/error.hpp"

namespace stiction::io {
namespace {

constexpr const char* kFormat = "world-checkpoint-parts";
constexpr std::int64_t kVersion = 1;

std::size_t at(Offset place) {
  return static_cast<std::size_t>(place);
}

std::string part_name(const std::string& base, std::int64_t step, std::int64_t k, std::int64_t n) {
  return base + ".step" + std::to_string(step) + ".part" + std::to_string(k) + "of" + std::to_string(n);
}

/// Files beside a checkpoint whose names are those of parts of it.
std::vector<std::filesystem::path> parts_beside(const std::filesystem::path& path) {
  const std::string begin = path.filename().string() + ".step";
  const auto is_number = [](const std::string& text) {
    return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
  };
  std::vector<std::filesystem::path> parts;
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(begin)) continue;
    const std::size_t part = name.find(".part", begin.size());
    const std::size_t of = part == std::string::npos ? part : name.find("of", part);
    if (of == std::string::npos) continue;
    if (is_number(name.substr(begin.size(), part - begin.size())) && is_number(name.substr(part + 5, of - part - 5)) &&
        is_number(name.substr(of + 2)))
      parts.push_back(entry.path());
  }
  return parts;
}

/// f(numbers of a body, numbers of one, of the other) for each array of bodies.
template <class F>
void for_each_body_array(WorldCheckpoint<double>& one, const WorldCheckpoint<double>& other, F&& f) {
  f(std::size_t{3}, one.position, other.position);
  f(std::size_t{4}, one.orientation, other.orientation);
  f(std::size_t{6}, one.twist, other.twist);
  f(std::size_t{6}, one.wrench, other.wrench);
}

/// Numbers of bodies and environments that a checkpoint has to have, compared with the lengths of its arrays.
void check_lengths(const InputFile& file, const WorldCheckpoint<double>& world, Offset environments, Offset bodies) {
  const auto held = static_cast<Offset>(world.contact_offsets.size()) - 1;
  if (held != environments)
    file.refuse("number of environments is " + std::to_string(held) + ", and " + std::to_string(environments) +
                " is asked for: ask for " + std::to_string(held) + ", or choose another file");
  const auto expect = [&](const char* name, std::size_t length, std::size_t expected) {
    if (length != expected)
      file.refuse_dataset(name, "has " + std::to_string(length) + " elements, expected " + std::to_string(expected));
  };
  const std::size_t all = at(environments) * at(bodies);
  expect("position", world.position.size(), 3 * all);
  expect("orientation", world.orientation.size(), 4 * all);
  expect("twist", world.twist.size(), 6 * all);
  expect("wrench", world.wrench.size(), 6 * all);
  expect("impulse", world.impulse.size(), 3 * world.contact_id.size());
}

/// Contacts of all parts, by id, each once.
void merge_contacts(const std::vector<WorldCheckpoint<double>>& parts, Offset environments,
                    WorldCheckpoint<double>& all) {
  struct Contact {
    std::uint64_t id;
    const double* impulse;
  };
  all.contact_offsets = {0};
  for (Offset env = 0; env < environments; ++env) {
    std::vector<Contact> contacts;
    for (const WorldCheckpoint<double>& part : parts)
      for (Offset c = part.contact_offsets[at(env)]; c < part.contact_offsets[at(env) + 1]; ++c)
        contacts.push_back({part.contact_id[at(c)], part.impulse.data() + 3 * c});
    std::sort(contacts.begin(), contacts.end(), [](const Contact& a, const Contact& b) { return a.id < b.id; });
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      if (k > 0 && contacts[k].id == contacts[k - 1].id) continue;
      all.contact_id.push_back(contacts[k].id);
      all.impulse.insert(all.impulse.end(), contacts[k].impulse, contacts[k].impulse + 3);
    }
    all.contact_offsets.push_back(static_cast<Offset>(all.contact_id.size()));
  }
}

/// A file's world, whose bodies begin with number `first` of the whole.
struct Piece {
  WorldCheckpoint<double> world;
  Offset first, bodies;
};

/// Appends those of the bodies that are there, environment after environment.
void put_bodies(const std::vector<Piece>& pieces, Offset environments, CheckpointBodies of,
                WorldCheckpoint<double>& all) {
  for (Offset env = 0; env < environments; ++env)
    for (const Piece& piece : pieces) {
      const Offset first = std::max(of.first, piece.first), end = std::min(of.end, piece.first + piece.bodies);
      if (first >= end) continue;
      const Offset begin = env * piece.bodies + first - piece.first;
      for_each_body_array(all, piece.world, [&](std::size_t width, std::vector<double>& to, const auto& from) {
        const auto row = from.begin() + static_cast<std::ptrdiff_t>(width) * begin;
        to.insert(to.end(), row, row + static_cast<std::ptrdiff_t>(width) * (end - first));
      });
    }
}

/// Reads the parts that have some of those bodies; of all bodies without `of`.
CheckpointShare read_parts(const std::filesystem::path& path, const InputFile& index,
                           std::optional<Offset> environments, std::optional<CheckpointBodies> of) {
  std::string base;
  const CheckpointParts parts = read_checkpoint_parts(index, base);
  const auto count = static_cast<Offset>(parts.checksums.size());
  CheckpointShare share;
  share.bodies = {0, parts.body_offsets.back()};
  if (of) share.bodies = {std::max(of->first, Offset{0}), std::min(of->end, parts.body_offsets.back())};
  share.file.run = parts.run;
  share.file.step = parts.step;
  std::vector<Piece> pieces;
  for (Offset k = 0; k < count; ++k) {
    const Offset first = parts.body_offsets[at(k)], bodies = parts.body_offsets[at(k) + 1] - first;
    if (of && (first >= share.bodies.end || first + bodies <= share.bodies.first)) continue;
    const std::filesystem::path name = path.parent_path() / part_name(base, parts.step, k, count);
    if (!std::filesystem::exists(name))
      index.refuse("names " + name.filename().string() +
                   ", which is not there: keep the parts of a checkpoint beside it");
    const InputFile file(name);
    if (checksum_of(file) != parts.checksums[at(k)])
      index.refuse("names " + name.filename().string() + ", which is of another checkpoint");
    CheckpointFile part = read_checkpoint(file);
    if (!environments) environments = static_cast<Offset>(part.world.contact_offsets.size()) - 1;
    check_lengths(file, part.world, *environments, bodies);
    share.file.precision = part.precision;
    pieces.push_back({std::move(part.world), first, bodies});
  }
  put_bodies(pieces, environments.value_or(0), share.bodies, share.file.world);
  std::vector<WorldCheckpoint<double>> worlds;
  for (Piece& piece : pieces) worlds.push_back(std::move(piece.world));
  merge_contacts(worlds, environments.value_or(0), share.file.world);
  return share;
}

}  // namespace

void remove_parts(const std::filesystem::path& path, const CheckpointParts& but) {
  const auto count = static_cast<std::int64_t>(but.checksums.size());
  std::vector<std::filesystem::path> kept;
  for (std::int64_t k = 0; k < count; ++k) kept.push_back(checkpoint_part(path, but.step, k, count).filename());
  for (const std::filesystem::path& part : parts_beside(path)) {
    std::error_code ignored;  // a part that stays is named by nothing
    if (std::find(kept.begin(), kept.end(), part.filename()) == kept.end()) std::filesystem::remove(part, ignored);
  }
}

bool is_in_parts(const InputFile& file) {
  return file.text_attribute("format") == kFormat;
}

CheckpointParts read_checkpoint_parts(const InputFile& file, std::string& base) {
  const std::int64_t version = file.integer_attribute("version").value_or(0);
  if (version != kVersion)
    file.refuse("attribute 'version' is " + std::to_string(version) + ", expected " + std::to_string(kVersion));
  base = file.text_attribute("parts").value_or("");
  if (base.empty() || base.find('/') != std::string::npos || base.find('\0') != std::string::npos)
    file.refuse("attribute 'parts' is '" + base + "', expected the name of a file beside this one");
  CheckpointParts parts;
  parts.run = file.text_attribute("run").value_or("");
  parts.step = file.integer_attribute("step").value_or(-1);
  if (parts.step < 0) file.refuse("attribute 'step' is missing or negative");
  parts.checksums = file.integers<std::int64_t>("checksums");
  if (parts.checksums.empty()) file.refuse_dataset("checksums", "is empty: a checkpoint has one part at least");
  parts.body_offsets = file.integers<Offset>("body_offsets", parts.checksums.size() + 1);
  if (parts.body_offsets.back() < 0 || parts.body_offsets.back() > std::numeric_limits<Index>::max())
    file.refuse_dataset("body_offsets",
                        "ends with " + std::to_string(parts.body_offsets.back()) + ", which is no number of bodies");
  check_offsets(file, "body_offsets", parts.body_offsets, at(parts.body_offsets.back()));
  return parts;
}

CheckpointHead read_checkpoint_head(const std::filesystem::path& path) {
  const InputFile file(path);
  if (!is_in_parts(file)) return read_checkpoint_head(file);
  std::string base;
  const CheckpointParts parts = read_checkpoint_parts(file, base);
  return {parts.run, parts.step};
}

CheckpointFile read_checkpoint(const std::filesystem::path& path) {
  const ScopedFpEnv fp_env;
  const InputFile file(path);
  return is_in_parts(file) ? read_parts(path, file, {}, {}).file : read_checkpoint(file);
}

CheckpointShare read_checkpoint(const std::filesystem::path& path, Offset environments, CheckpointBodies bodies) {
  const ScopedFpEnv fp_env;
  const InputFile file(path);
  if (is_in_parts(file)) return read_parts(path, file, environments, bodies);
  CheckpointFile whole = read_checkpoint(file);
  const Offset count = environments > 0 ? static_cast<Offset>(whole.world.position.size()) / (3 * environments) : 0;
  check_lengths(file, whole.world, environments, count);
  CheckpointShare share;
  share.file.precision = whole.precision;
  share.file.run = whole.run;
  share.file.step = whole.step;
  share.file.world.contact_offsets = whole.world.contact_offsets;
  share.file.world.contact_id = whole.world.contact_id;
  share.file.world.impulse = whole.world.impulse;
  share.bodies = {std::max(bodies.first, Offset{0}), std::min(bodies.end, count)};
  put_bodies({Piece{std::move(whole.world), 0, count}}, environments, share.bodies, share.file.world);
  return share;
}

std::filesystem::path checkpoint_part(const std::filesystem::path& path, std::int64_t step, std::int64_t k,
                                      std::int64_t n) {
  return path.parent_path() / part_name(path.filename().string(), step, k, n);
}

void write_checkpoint_parts(const std::filesystem::path& path, const CheckpointParts& parts) {
  OutputFile file(path);
  file.attribute("format", kFormat);
  file.attribute("version", kVersion);
  file.attribute("parts", path.filename().string());
  file.attribute("run", parts.run);
  file.attribute("step", parts.step);
  file.array("body_offsets", std::span<const std::int64_t>(parts.body_offsets));
  file.array("checksums", std::span<const std::int64_t>(parts.checksums));
  file.commit_to_disk();
  remove_parts(path, parts);
}

}  // namespace stiction::io
