#include <atomic>
#include <cmath>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "core/base/fp_env.hpp"
#include "core/machine/body_machine.hpp"
#include "core/runtime/check/defects.hpp"
#include "stiction/batch_arrays.hpp"
#include "stiction/error.hpp"

namespace stiction {

template <class Real>
void BodyBatch<Real>::add(const BodyEnvironment<Real>& environment) {
  const ScopedFpEnv fp_env;
  const auto bodies = static_cast<Index>(environment.bodies.size());
  for (std::size_t c = 0; c < environment.contacts.size(); ++c) {
    const auto& contact = environment.contacts[c];
    const auto name = [&](const char* field, Index value) {
      return "contacts[" + std::to_string(c) + "]." + field + " = " + std::to_string(value);
    };
    for (const auto& [field, body] : {std::pair("body_a", contact.body_a), std::pair("body_b", contact.body_b)})
      if (body < -1 || body >= bodies)
        throw Error(ErrorCode::invalid_argument, name(field, body) + ": expected a body in 0.." +
                                                     std::to_string(bodies - 1) + ", or -1 for the world");
    if (contact.body_a == contact.body_b)
      throw Error(ErrorCode::invalid_argument,
                  name("body_a", contact.body_a) + " equals body_b: a contact needs two bodies; leave it out");
  }
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  for (const auto& body : environment.bodies) {
    arrays_.inv_mass.push_back(body.inv_mass);
    append(arrays_.inv_inertia, body.inv_inertia);
    append(arrays_.twist, body.twist);
    append(arrays_.twist_change, body.twist_change);
    arrays_.kinematic.push_back(body.kinematic ? 1 : 0);
  }
  for (const auto& contact : environment.contacts) {
    arrays_.body_a.push_back(contact.body_a);
    arrays_.body_b.push_back(contact.body_b);
    append(arrays_.arm_a, contact.arm_a);
    append(arrays_.arm_b, contact.arm_b);
    append(arrays_.normal, contact.normal);
    arrays_.mu.push_back(contact.mu);
    arrays_.depth.push_back(contact.depth);
    arrays_.restitution.push_back(contact.restitution);
    arrays_.contact_id.push_back(contact.id);
  }
  arrays_.env_body_offsets.push_back(static_cast<Offset>(arrays_.inv_mass.size()));
  arrays_.env_contact_offsets.push_back(static_cast<Offset>(arrays_.mu.size()));
}

template <class Real>
BodyBatchView<Real> BodyArrays<Real>::view() const noexcept {
  BodyBatchView<Real> view;
  view.env_count = static_cast<Offset>(env_body_offsets.size()) - 1;
  view.body_count = env_body_offsets.back();
  view.contact_count = env_contact_offsets.back();
  for_each_array(view, PointAt{}, view, *this);
  view.contact_id = contact_id.empty() ? nullptr : contact_id.data();
  return view;
}

namespace {

/// "mu[env 3, contact 7] = ".
template <class Real>
std::string entry(const char* array, Offset env, const char* what, Index index, Real value) {
  return std::string(array) + "[env " + std::to_string(env) + ", " + what + " " + std::to_string(index) +
         "] = " + shortest_text(value);
}

/// Which of the arrays that a plan reads is not there, or null.
template <class Real>
const char* missing_side(const BodyBatchView<Real>& batch) {
  if (batch.contact_count == 0) return nullptr;
  return batch.body_a == nullptr ? "body_a" : batch.body_b == nullptr ? "body_b" : nullptr;
}

/// Allowed distance of a normal's squared length from 1: a scale of the impulses that does not show.
constexpr float kNormalTolerance = 1e-3F;

/// One look at a batch whose offsets are sound: returns true if it has no defect at all, as nearly every batch. False
/// means nothing. No branch on the data.
template <class Real>
class BodySurvey {
 public:
  explicit BodySurvey(const BodyBatchView<Real>& batch) : batch_(batch) {}

  [[nodiscard]] bool passes(const ParallelFor& parallel_for, bool with_values) const {
    std::atomic<bool> passes = true;
    parallel_for(batch_.env_count, [&](Offset begin, Offset end) {
      if (!sides_pass(begin, end) || (with_values && !(bodies_pass(begin, end) && contacts_pass(begin, end))))
        passes.store(false, std::memory_order_relaxed);
    });
    return passes.load();
  }

 private:
  [[nodiscard]] bool sides_pass(Offset begin, Offset end) const {
    unsigned broken = 0;
    for (Offset env = begin; env < end; ++env) {
      const auto bodies = static_cast<Index>(batch_.env_body_offsets[env + 1] - batch_.env_body_offsets[env]);
      for (Offset k = batch_.env_contact_offsets[env]; k < batch_.env_contact_offsets[env + 1]; ++k) {
        const Index a = batch_.body_a[k], b = batch_.body_b[k];
        broken |= static_cast<unsigned>((a < -1) | (b < -1) | (a >= bodies) | (b >= bodies) | (a == b));
      }
    }
    return broken == 0;
  }
  /// True if bodies are sound, kinematic ones that are not used included.
  [[nodiscard]] bool bodies_pass(Offset begin, Offset end) const {
    const Offset first = batch_.env_body_offsets[begin], count = batch_.env_body_offsets[end] - first;
    return all_finite(part(batch_.twist, 6, first, count)) && all_finite(part(batch_.inv_inertia, 6, first, count)) &&
           (batch_.twist_change == nullptr || all_finite(part(batch_.twist_change, 6, first, count))) &&
           all_finite_nonnegative(part(batch_.inv_mass, 1, first, count));
  }
  [[nodiscard]] bool contacts_pass(Offset begin, Offset end) const {
    const Offset first = batch_.env_contact_offsets[begin], count = batch_.env_contact_offsets[end] - first;
    unsigned broken = 0;
    for (Offset k = first; k < first + count; ++k) {
      const Real* const n = batch_.normal + 3 * k;
      const Real length2 = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
      const Real restitution = batch_.restitution[k];
      broken |= static_cast<unsigned>(!((std::abs(length2 - Real(1)) <= Real(kNormalTolerance)) &
                                        (restitution >= Real(0)) & (restitution <= Real(1))));
    }
    return broken == 0 && all_finite(part(batch_.arm_a, 3, first, count)) &&
           all_finite(part(batch_.arm_b, 3, first, count)) && all_finite(part(batch_.depth, 1, first, count)) &&
           all_finite_nonnegative(part(batch_.mu, 1, first, count));
  }
  static std::span<const Real> part(const Real* values, Offset each, Offset first, Offset count) {
    return {values + each * first, static_cast<std::size_t>(each * count)};
  }

  const BodyBatchView<Real>& batch_;
};

/// Finds the defects and describes them, which takes longer.
template <class Real>
class BodyValidator {
 public:
  BodyValidator(const BodyBatchView<Real>& batch, std::size_t limit) : batch_(batch), limit_(limit), report_(limit) {}

  std::vector<Defect> run(const ParallelFor& parallel_for) {
    if (offsets_hold(true) && !BodySurvey<Real>(batch_).passes(parallel_for, true) && sides_hold(parallel_for))
      look(parallel_for, [](BodyValidator& part, Offset env) {
        part.see_bodies(env);
        part.see_contacts(env);
      });
    return report_.take();
  }
  std::vector<Defect> run_structure(const ParallelFor& parallel_for) {
    if (offsets_hold(false) && !BodySurvey<Real>(batch_).passes(parallel_for, false)) sides_hold(parallel_for);
    return report_.take();
  }

 private:
  /// see(part, env) for all environments, by a validator for each part of them. Their defects are reported in order,
  /// whichever part found them first. Returns true if there are none.
  template <class See>
  bool look(const ParallelFor& parallel_for, const See& see) {
    std::mutex mutex;
    std::map<Offset, std::vector<Defect>> found;
    parallel_for(batch_.env_count, [&](Offset begin, Offset end) {
      BodyValidator part(batch_, limit_);
      for (Offset env = begin; env < end && !part.report_.full(); ++env) see(part, env);
      std::vector<Defect> defects = part.report_.take();
      if (defects.empty()) return;
      const std::scoped_lock lock(mutex);
      found.emplace(begin, std::move(defects));
    });
    for (auto& [begin, defects] : found)
      for (Defect& defect : defects) report_.add(std::move(defect));
    return found.empty();
  }

  bool offsets_hold(bool with_numbers) {
    const auto place = [](Offset env) { return Defect{env, -1, -1, true, ""}; };
    const auto offsets = [&](const char* name, const Offset* values, Offset total, const char* total_name) {
      return check_offsets(name, std::span(values, static_cast<std::size_t>(batch_.env_count) + 1), total, total_name,
                           place, report_);
    };
    if (batch_.env_count < 0 || batch_.env_body_offsets == nullptr || batch_.env_contact_offsets == nullptr) {
      report_.add({-1, -1, -1, true,
                   "env_count = " + std::to_string(batch_.env_count) +
                       ", env_body_offsets or env_contact_offsets is null: expected env_count >= 0 and both offsets"});
      return false;
    }
    bool sound = offsets("env_body_offsets", batch_.env_body_offsets, batch_.body_count, "bodies");
    sound = offsets("env_contact_offsets", batch_.env_contact_offsets, batch_.contact_count, "contacts") && sound;
    const char* name = missing_array(batch_);
    if (!with_numbers) name = missing_side(batch_);
    if (name != nullptr) {
      report_.add({-1, -1, -1, true, std::string(name) + " is null; point it to the batch's array"});
      sound = false;
    }
    return sound;
  }

  bool sides_hold(const ParallelFor& parallel_for) {
    return look(parallel_for, [](BodyValidator& part, Offset env) { part.see_sides(env); });
  }

  void see_sides(Offset env) {
    const auto bodies = static_cast<Index>(batch_.env_body_offsets[env + 1] - batch_.env_body_offsets[env]);
    const auto fail = [&](const char* array, Index contact, Index value, const char* remedy) {
      report_.add({env, contact, value, true, entry(array, env, "contact", contact, value) + remedy});
    };
    const Offset first = batch_.env_contact_offsets[env];
    for (Offset k = first; k < batch_.env_contact_offsets[env + 1]; ++k) {
      const auto contact = static_cast<Index>(k - first);
      for (const auto& [array, body] : {std::pair("body_a", batch_.body_a[k]), std::pair("body_b", batch_.body_b[k])})
        if (body < -1 || body >= bodies)
          fail(array, contact, body, ": there is no such body in this environment; -1 is the world");
      if (batch_.body_a[k] == batch_.body_b[k])
        fail("body_a", contact, batch_.body_a[k], " equals body_b: a contact needs two bodies; leave it out");
    }
  }

  void see_bodies(Offset env) {
    const Offset first = batch_.env_body_offsets[env];
    for (Offset k = first; k < batch_.env_body_offsets[env + 1]; ++k) {
      const auto body = static_cast<Index>(k - first);
      const auto fail = [&](const std::string& message) { report_.add({env, -1, body, false, message}); };
      const auto finite = [&](const char* array, const Real* values, Offset count) {
        for (Offset i = 0; i < count; ++i)
          if (!std::isfinite(values[i])) fail(entry(array, env, "body", body, values[i]) + ": must be finite");
      };
      finite("twist", batch_.twist + 6 * k, 6);
      if (batch_.kinematic != nullptr && batch_.kinematic[k] != 0) continue;
      finite("inv_inertia", batch_.inv_inertia + 6 * k, 6);
      if (batch_.twist_change != nullptr) finite("twist_change", batch_.twist_change + 6 * k, 6);
      if (!(batch_.inv_mass[k] >= Real(0)) || !std::isfinite(batch_.inv_mass[k]))
        fail(entry("inv_mass", env, "body", body, batch_.inv_mass[k]) + ": must be finite and >= 0");
    }
  }

  void see_contacts(Offset env) {
    const Offset first = batch_.env_contact_offsets[env];
    for (Offset k = first; k < batch_.env_contact_offsets[env + 1]; ++k) {
      const auto contact = static_cast<Index>(k - first);
      const auto fail = [&](const std::string& message) { report_.add({env, contact, -1, false, message}); };
      for (const auto& [array, values] : {std::pair("arm_a", batch_.arm_a), std::pair("arm_b", batch_.arm_b)})
        for (Offset i = 3 * k; i < 3 * k + 3; ++i)
          if (!std::isfinite(values[i])) fail(entry(array, env, "contact", contact, values[i]) + ": must be finite");
      const Real* n = batch_.normal + 3 * k;
      const Real length2 = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
      if (!(std::abs(length2 - Real(1)) <= Real(kNormalTolerance)))
        fail(entry("normal", env, "contact", contact, std::sqrt(length2)) + " long: must be a unit vector; divide it");
      if (!(batch_.mu[k] >= Real(0)) || !std::isfinite(batch_.mu[k]))
        fail(entry("mu", env, "contact", contact, batch_.mu[k]) + ": friction must be finite and >= 0");
      if (!std::isfinite(batch_.depth[k]))
        fail(entry("depth", env, "contact", contact, batch_.depth[k]) + ": must be finite");
      if (!(batch_.restitution[k] >= Real(0) && batch_.restitution[k] <= Real(1)))
        fail(entry("restitution", env, "contact", contact, batch_.restitution[k]) + ": must be in [0, 1]");
    }
  }

  const BodyBatchView<Real>& batch_;
  std::size_t limit_;
  DefectReport report_;
};

}  // namespace

template <class Real>
std::vector<Defect> validate(const BodyBatchView<Real>& batch, std::size_t limit, const ParallelFor& parallel_for) {
  return BodyValidator<Real>(batch, limit).run(parallel_for);
}

template <class Real>
std::vector<Defect> validate(const BodyBatchView<Real>& batch, std::size_t limit) {
  const ScopedFpEnv fp_env;
  return validate(batch, limit, all_at_once);
}

template <class Real>
std::vector<Defect> validate_structure(const BodyBatchView<Real>& batch, std::size_t limit,
                                       const ParallelFor& parallel_for) {
  return BodyValidator<Real>(batch, limit).run_structure(parallel_for);
}

template struct BodyArrays<float>;
template struct BodyArrays<double>;
template class BodyBatch<float>;
template class BodyBatch<double>;
template std::vector<Defect> validate(const BodyBatchView<float>&, std::size_t);
template std::vector<Defect> validate(const BodyBatchView<double>&, std::size_t);
template std::vector<Defect> validate(const BodyBatchView<float>&, std::size_t, const ParallelFor&);
template std::vector<Defect> validate(const BodyBatchView<double>&, std::size_t, const ParallelFor&);
template std::vector<Defect> validate_structure(const BodyBatchView<float>&, std::size_t, const ParallelFor&);
template std::vector<Defect> validate_structure(const BodyBatchView<double>&, std::size_t, const ParallelFor&);

}  // namespace stiction
