// Tells the manager of services what the service does: datagrams to the socket that NOTIFY_SOCKET names (sd_notify(3)).
#pragma once

#include <string>
#include <string_view>

namespace margay::service {

class Notifier {
  public:
    // Reads NOTIFY_SOCKET and removes it from the environment. Without NOTIFY_SOCKET the other functions do nothing.
    Notifier();

    void ready() { send("READY=1"); }
    void reloading();
    void stopping() { send("STOPPING=1"); }
    // Sends the text if it has changed.
    void status(const std::string& text);

  private:
    void send(std::string_view message) const;

    std::string path_{};
    std::string status_{};
};

}  // namespace margay::service
