/* Outputs and inputs of the same slaves in two domains, the inputs also at half the rate in a third one. Ends with 0
 * when each domain has its own working counter, and what is written to the outputs comes back by the inputs. */
#include "cycle.h"

#include <ecrt.h>
#include <stdio.h>

#define DRIVE 0x00004D47, 0x5402
#define DIG_IN_8 0x00004D47, 0x1008
#define DIG_OUT_8 0x00004D47, 0x2008

static unsigned int off_control, off_mode, off_status, off_mode_display, off_in, bit_in, off_out, bit_out;

static const ec_pdo_entry_reg_t outputs[] = {{0, 0, DRIVE, 0x6040, 0, &off_control, NULL},
                                             {0, 0, DRIVE, 0x6060, 0, &off_mode, NULL},
                                             {0, 2, DIG_OUT_8, 0x7030, 1, &off_out, &bit_out},
                                             {0}};
static const ec_pdo_entry_reg_t inputs[] = {
    {0, 0, DRIVE, 0x6041, 0, &off_status, NULL}, {0, 0, DRIVE, 0x6061, 0, &off_mode_display, NULL}, {0}};
static const ec_pdo_entry_reg_t slow[] = {{0, 1, DIG_IN_8, 0x6020, 1, &off_in, &bit_in}, {0}};

int main(void) {
    ec_master_t* master = ecrt_request_master(0);
    ec_domain_t *out, *in, *rare;
    ec_domain_state_t out_state, in_state, rare_state;
    uint8_t *out_pd, *in_pd;
    unsigned int good = 0;
    if (!master) return 1;
    out = ecrt_master_create_domain(master);
    in = ecrt_master_create_domain(master);
    rare = ecrt_master_create_domain(master);
    if (!out || !in || !rare) return 1;
    if (ecrt_domain_reg_pdo_entry_list(out, outputs) || ecrt_domain_reg_pdo_entry_list(in, inputs) ||
        ecrt_domain_reg_pdo_entry_list(rare, slow))
        return 1;
    printf("%u %u %u.%u, %u %u, %u.%u\n", off_control, off_mode, off_out, bit_out, off_status, off_mode_display, off_in,
           bit_in);
    /* The PDOs of the slaves themselves. */
    if (off_control != 0 || off_mode != 12 || off_out != 14 || bit_out != 3 || off_status != 0 ||
        off_mode_display != 12 || bit_in != 2)
        return 2;
    if (ecrt_domain_size(out) != 15 || ecrt_domain_size(in) != 20 || ecrt_domain_size(rare) != 1) return 2;
    if (ecrt_domain_data(in) != NULL) return 2;
    if (ecrt_master_activate(master)) return 1;
    out_pd = ecrt_domain_data(out);
    in_pd = ecrt_domain_data(in);
    if (!out_pd || !in_pd || ecrt_master_create_domain(master)) return 1;
    for (unsigned int n = 0; n < 20000 && good < 200; ++n) {
        next_cycle();
        ecrt_master_receive(master);
        ecrt_domain_process(out);
        ecrt_domain_process(in);
        if (n % 2 == 0) ecrt_domain_process(rare);
        ecrt_domain_state(out, &out_state);
        ecrt_domain_state(in, &in_state);
        ecrt_domain_state(rare, &rare_state);
        EC_WRITE_U8(out_pd + off_mode, 8); /* cyclic synchronous position */
        EC_WRITE_U16(out_pd + off_control, EC_READ_U16(in_pd + off_status) & 0x0040 ? 0x06 : 0x07);
        EC_WRITE_BIT(out_pd + off_out, bit_out, 1);
        ecrt_domain_queue(out);
        ecrt_domain_queue(in);
        if (n % 2 == 1) ecrt_domain_queue(rare);
        ecrt_master_send(master);
        good =
            count_right(good, out_state.wc_state == EC_WC_COMPLETE && in_state.wc_state == EC_WC_COMPLETE &&
                                  rare_state.wc_state == EC_WC_COMPLETE && EC_READ_U8(in_pd + off_mode_display) == 8);
    }
    printf("WC %u %u %u, mode %u\n", out_state.working_counter, in_state.working_counter, rare_state.working_counter,
           EC_READ_U8(in_pd + off_mode_display));
    if (good < 200) return 3;
    /* Each domain has one direction only, so that each slave counts 1. */
    if (out_state.working_counter != 2 || in_state.working_counter != 1 || rare_state.working_counter != 1) return 4;
    /* And a second configuration after the first. */
    if (ecrt_master_deactivate(master)) return 5;
    if (!(out = ecrt_master_create_domain(master)) || ecrt_domain_reg_pdo_entry_list(out, inputs) ||
        ecrt_master_activate(master) || !ecrt_domain_data(out))
        return 6;
    good = 0;
    for (unsigned int n = 0; n < 20000 && good < 50; ++n) {
        next_cycle();
        ecrt_master_receive(master);
        ecrt_domain_process(out);
        ecrt_domain_state(out, &out_state);
        ecrt_domain_queue(out);
        ecrt_master_send(master);
        good = count_right(good, out_state.wc_state == EC_WC_COMPLETE && out_state.working_counter == 1);
    }
    if (good < 50) return 7;
    ecrt_release_master(master);
    return 0;
}
