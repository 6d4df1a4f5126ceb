/* A program as users of the interface begin: one domain with digital and analogue terminals behind a coupler, a cyclic
 * task of 1 ms, and states that are printed when they change. Ends with 0 when everything was in OP and the domain
 * complete for a while. */
#include "cycle.h"

#include <ecrt.h>
#include <stdio.h>

#define VENDOR 0x00004D47
#define BUS_COUPLER_POS 0, 0
#define DIG_IN_POS 0, 1
#define DIG_OUT_POS 0, 2
#define ANA_IN_POS 0, 3
#define ANA_OUT_POS 0, 4
#define COUPLER VENDOR, 0x0100
#define DIG_IN_8 VENDOR, 0x1008
#define DIG_OUT_8 VENDOR, 0x2008
#define ANA_IN_4 VENDOR, 0x3004
#define ANA_OUT_2 VENDOR, 0x4002

static ec_master_t* master = NULL;
static ec_master_state_t master_state;
static ec_domain_t* domain1 = NULL;
static ec_domain_state_t domain1_state;
static ec_slave_config_t* sc_ana_in = NULL;
static ec_slave_config_state_t sc_ana_in_state;
static uint8_t* domain1_pd = NULL;

static unsigned int off_dig_in, bit_dig_in, off_dig_out, off_ana_in, off_ana_out0, off_ana_out1;

static const ec_pdo_entry_reg_t domain1_regs[] = {{DIG_IN_POS, DIG_IN_8, 0x6070, 1, &off_dig_in, &bit_dig_in},
                                                  {DIG_OUT_POS, DIG_OUT_8, 0x7000, 1, &off_dig_out, NULL},
                                                  {ANA_IN_POS, ANA_IN_4, 0x6000, 0x11, &off_ana_in, NULL},
                                                  {ANA_OUT_POS, ANA_OUT_2, 0x7000, 0x11, &off_ana_out0, NULL},
                                                  {ANA_OUT_POS, ANA_OUT_2, 0x7010, 0x11, &off_ana_out1, NULL},
                                                  {0, 0, 0, 0, 0, 0, NULL, NULL}};

static void check_domain1_state(void) {
    ec_domain_state_t ds;
    ecrt_domain_state(domain1, &ds);
    if (ds.working_counter != domain1_state.working_counter) printf("Domain1: WC %u.\n", ds.working_counter);
    if (ds.wc_state != domain1_state.wc_state) printf("Domain1: State %u.\n", ds.wc_state);
    domain1_state = ds;
}

static void check_master_state(void) {
    ec_master_state_t ms;
    ecrt_master_state(master, &ms);
    if (ms.slaves_responding != master_state.slaves_responding) printf("%u slave(s).\n", ms.slaves_responding);
    if (ms.al_states != master_state.al_states) printf("AL states: 0x%02X.\n", ms.al_states);
    if (ms.link_up != master_state.link_up) printf("Link is %s.\n", ms.link_up ? "up" : "down");
    master_state = ms;
}

static void check_slave_config_states(void) {
    ec_slave_config_state_t s;
    ecrt_slave_config_state(sc_ana_in, &s);
    if (s.al_state != sc_ana_in_state.al_state) printf("AnaIn: State 0x%02X.\n", s.al_state);
    if (s.online != sc_ana_in_state.online) printf("AnaIn: %s.\n", s.online ? "online" : "offline");
    if (s.operational != sc_ana_in_state.operational) printf("AnaIn: %soperational.\n", s.operational ? "" : "Not ");
    sc_ana_in_state = s;
}

static unsigned int good = 0;

static void cyclic_task(unsigned int n) {
    ecrt_master_receive(master);
    ecrt_domain_process(domain1);
    check_domain1_state();
    if (n % 10 == 0) {
        check_master_state();
        check_slave_config_states();
    }
    EC_WRITE_U8(domain1_pd + off_dig_out, n & 0x80 ? 0x06 : 0x09);
    EC_WRITE_S16(domain1_pd + off_ana_out1, -1234);
    ecrt_domain_queue(domain1);
    ecrt_master_send(master);
    good = count_right(good, domain1_state.wc_state == EC_WC_COMPLETE && master_state.al_states == 0x08 &&
                                 sc_ana_in_state.operational);
}

int main(void) {
    ec_slave_config_t* sc;
    master = ecrt_request_master(0);
    if (!master) return 1;
    domain1 = ecrt_master_create_domain(master);
    if (!domain1) return 1;
    sc_ana_in = ecrt_master_slave_config(master, ANA_IN_POS, ANA_IN_4);
    if (!sc_ana_in) return 1;
    sc = ecrt_master_slave_config(master, BUS_COUPLER_POS, COUPLER);
    if (!sc) return 1;
    if (ecrt_domain_reg_pdo_entry_list(domain1, domain1_regs)) {
        fprintf(stderr, "PDO entry registration failed!\n");
        return 1;
    }
    printf("offsets %u.%u %u %u %u %u of %u\n", off_dig_in, bit_dig_in, off_dig_out, off_ana_in, off_ana_out0,
           off_ana_out1, (unsigned int)ecrt_domain_size(domain1));
    /* In the order of the registrations, SyncManager by SyncManager. */
    if (off_dig_in != 0 || bit_dig_in != 7 || off_dig_out != 1 || off_ana_in != 2 || off_ana_out0 != 10 ||
        off_ana_out1 != 12 || ecrt_domain_size(domain1) != 14)
        return 2;
    if (ecrt_master_activate(master)) return 1;
    if (!(domain1_pd = ecrt_domain_data(domain1))) return 1;
    for (unsigned int n = 0; n < 20000 && good < 200; ++n) {
        next_cycle();
        cyclic_task(n);
    }
    ecrt_master_state(master, &master_state);
    printf("%u slaves, AL 0x%x, WC %u\n", master_state.slaves_responding, master_state.al_states,
           domain1_state.working_counter);
    /* Outputs count 2 and inputs 1, because one datagram has both. */
    if (good < 200 || master_state.slaves_responding != 5 || domain1_state.working_counter != 6) return 3;
    ecrt_release_master(master);
    return 0;
}
