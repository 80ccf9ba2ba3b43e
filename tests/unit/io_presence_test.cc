// link: engram_io
// Of any number of controllers that start, at most one serves, and the one in service stays.
#include "controller/io/io_presence.h"

#include <gtest/gtest.h>

#include "tests/support/wire.h"

namespace engram::test {
namespace {

using io::Presence;

// Everybody hears everybody, and themselves.
struct Network {
  std::vector<Presence*> all;
  std::vector<Wire> wires = std::vector<Wire>(8);
  void settle() {
    for (bool quiet = false; !quiet;) {
      quiet = true;
      for (Wire& w : wires) {
        std::vector<Sent> sent;
        sent.swap(w.sent);
        for (const Sent& s : sent) {
          quiet = false;
          for (Presence* p : all) p->on_presence(s.bytes.data(), static_cast<uint32_t>(s.bytes.size()));
        }
      }
    }
  }
};

TEST(Presence, AloneItServes) {
  Network net;
  Presence a(1, net.wires[0].sender());
  net.all = {&a};
  a.ask();
  net.settle();
  EXPECT_FALSE(a.taken());
}

TEST(Presence, ANewcomerLeavesTheOneInServiceAlone) {
  Network net;
  Presence old(5, net.wires[0].sender());
  old.serve();
  for (int64_t id : {3, 9}) {  // whatever the clocks say
    Presence newcomer(id, net.wires[1].sender());
    net.all = {&old, &newcomer};
    newcomer.ask();
    net.settle();
    EXPECT_TRUE(newcomer.taken());
    EXPECT_FALSE(old.taken());
  }
}

TEST(Presence, OfTwoThatStartTogetherTheFirstStays) {
  Network net;
  Presence a(10, net.wires[0].sender()), b(11, net.wires[1].sender());
  net.all = {&a, &b};
  a.ask();
  b.ask();
  net.settle();
  EXPECT_FALSE(a.taken());
  EXPECT_TRUE(b.taken());
  // even if the first one's question was lost
  Presence c(20, net.wires[2].sender()), d(21, net.wires[3].sender());
  net.all = {&c, &d};
  d.ask();
  net.settle();
  EXPECT_FALSE(c.taken());
  EXPECT_TRUE(d.taken());
}

TEST(Presence, ACommandOfSomebodyElseIsEnough) {
  Network net;
  Presence a(1, net.wires[0].sender());
  a.on_command();
  EXPECT_TRUE(a.taken());
  Presence b(2, net.wires[1].sender());
  b.serve();
  b.on_command();  // its own
  EXPECT_FALSE(b.taken());
}

TEST(Presence, GarbageIsNobody) {
  Network net;
  Presence a(1, net.wires[0].sender());
  a.on_presence("garbage", 7);
  a.on_presence(nullptr, 0);
  EXPECT_FALSE(a.taken());
}

}  // namespace
}  // namespace engram::test
