#include "distributed/subdomains/subdomains.hpp"

#include <algorithm>

namespace stiction::distributed {

namespace {

std::size_t at(Offset index) {
  return static_cast<std::size_t>(index);
}

}  // namespace

template <class Real>
Subdomains make_subdomains(const BodyBatchView<Real>& batch, std::span<const int> part, int count) {
  Subdomains made;
  made.contacts.resize(at(count));
  made.bodies.resize(at(count));
  made.holders.resize(at(batch.body_count));
  const auto is_pushed = [&](Index body) {
    return body >= 0 && (batch.kinematic == nullptr || batch.kinematic[body] == 0);
  };
  for (Offset c = 0; c < batch.contact_count; ++c) {
    const Index a = batch.body_a[c], b = batch.body_b[c];
    const Index home = is_pushed(a) || b < 0 ? a : is_pushed(b) || a < 0 ? b : a;
    const int subdomain = home < 0 ? 0 : part[at(home)];
    made.contacts[at(subdomain)].push_back(static_cast<Index>(c));
    for (const Index body : {a, b})
      if (body >= 0) made.bodies[at(subdomain)].push_back(body);
  }
  for (int subdomain = 0; subdomain < count; ++subdomain) {
    std::vector<Index>& bodies = made.bodies[at(subdomain)];
    std::sort(bodies.begin(), bodies.end());
    bodies.erase(std::unique(bodies.begin(), bodies.end()), bodies.end());
    for (const Index body : bodies)
      if (is_pushed(body)) made.holders[at(body)].push_back(subdomain);
  }
  return made;
}

template Subdomains make_subdomains(const BodyBatchView<float>&, std::span<const int>, int);
template Subdomains make_subdomains(const BodyBatchView<double>&, std::span<const int>, int);

}  // namespace stiction::distributed
