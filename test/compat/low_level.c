/* Frames and mailbox messages that a program builds itself. low_level SOURCE: the first slave has a mailbox with CoE and
   without VoE. */
#include "must.h"

#ifdef SOEM2
#include <soem/soem.h>
#define SLAVES context.slavelist
static ecx_contextt context;
#define CTX (&context)
#define PORT (&context.port)
#define CONFIG_INIT() ecx_config_init(CTX)
#else
#include <ethercat.h>
#define SLAVES ec_slave
#define CTX (&ecx_context)
#define PORT (&ecx_port)
#define CONFIG_INIT() ecx_config_init(CTX, FALSE)
#endif

#include <stdio.h>
#include <string.h>

#define USER_RAM 0x0F80

static int wrong;

static uint16 user_ram(void) { return etohs(ecx_FPRDw(PORT, SLAVES[1].configadr, USER_RAM, EC_TIMEOUTSAFE)); }

/* A frame that writes the value and reads the station address. Returns where the address will be. */
static int build(uint8 idx, uint16 value) {
    uint16 word = htoes(value);
    ec_setupheader(&PORT->txbuf[idx]);
    ecx_setupdatagram(PORT, &PORT->txbuf[idx], EC_CMD_FPWR, idx, SLAVES[1].configadr, USER_RAM, 2, &word);
    return ecx_adddatagram(PORT, &PORT->txbuf[idx], EC_CMD_FPRD, idx, FALSE, SLAVES[1].configadr, ECT_REG_STADR, 2, &word);
}

/* The frame is on the wire when the program has sent it, and comes back when the program waits for it. */
static void frames(void) {
    const uint8 idx = (uint8)ecx_getindex(PORT);
    uint16 word = 0;
    int at = build(idx, 0x1111);
    MUST(ecx_outframe(PORT, idx, 0) == PORT->txbuflength[idx]);
    MUST(user_ram() == 0x1111);
    MUST(ecx_waitinframe(PORT, idx, EC_TIMEOUTSAFE) == 1);
    memcpy(&word, &PORT->rxbuf[idx][at], 2);
    MUST(etohs(word) == SLAVES[1].configadr);
    MUST(ecx_waitinframe(PORT, idx, EC_TIMEOUTRET) == EC_NOFRAME); /* it was taken */

    /* Sent again before it was taken, and looked for again and again. */
    (void)build(idx, 0x2222);
    MUST(ecx_outframe_red(PORT, idx) > 0);
    (void)build(idx, 0x3333);
    MUST(ecx_outframe_red(PORT, idx) > 0);
    {
        int tries = 100, wkc;
        do {
            wkc = ecx_waitinframe(PORT, idx, 0);
            osal_usleep(100);
        } while (wkc < 0 && --tries > 0);
        MUST(wkc == 1 && user_ram() == 0x3333);
    }
    /* A frame that nobody waits for; then other functions, and the end of the master. */
    (void)build(idx, 0x4444);
    MUST(ecx_outframe(PORT, idx, 0) > 0);
    ecx_setbufstat(PORT, idx, EC_BUF_EMPTY);
    MUST(user_ram() == 0x4444);
    PORT->txbuflength[idx] = 0;
    MUST(ecx_outframe(PORT, idx, 0) < 0 && ecx_srconfirm(PORT, idx, EC_TIMEOUTRET) == EC_NOFRAME);
}

/* The slave refuses a message of a protocol that it does not have: that is in the list of errors, and the program waits
   on for an answer. */
static void refused_message(void) {
    ec_mbxheadert header;
    ec_errort error;
    int got;
    memset(&header, 0, sizeof(header));
    header.length = htoes(8);
    header.mbxtype = ECT_MBXT_VOE;
#ifdef SOEM2
    {
        ec_mbxbuft *mail = ecx_getmbx(CTX);
        MUST(mail != NULL);
        ec_clearmbx(mail);
        memcpy(mail, &header, sizeof(header));
        MUST(ecx_mbxsend(CTX, 1, mail, EC_TIMEOUTTXM) > 0);
        mail = NULL;
        got = ecx_mbxreceive(CTX, 1, &mail, EC_TIMEOUTRXM / 10);
    }
#else
    {
        ec_mbxbuft mail;
        ec_clearmbx(&mail);
        memcpy(&mail, &header, sizeof(header));
        MUST(ecx_mbxsend(CTX, 1, &mail, EC_TIMEOUTTXM) > 0);
        got = ecx_mbxreceive(CTX, 1, &mail, EC_TIMEOUTRXM / 10);
    }
#endif
    MUST(got <= 0);
    MUST(ecx_iserror(CTX) && ecx_poperror(CTX, &error));
    MUST(error.Etype == EC_ERR_TYPE_MBX_ERROR && error.Slave == 1);
    MUST(error.ErrorCode == 2); /* the protocol is not supported */
    MUST(strstr(ecx_err2string(error), "MBX") != NULL);
    MUST(!ecx_iserror(CTX));
}

int main(int argc, char **argv) {
    if (argc != 2 || ecx_init(CTX, argv[1]) <= 0) return 2;
    MUST(CONFIG_INIT() >= 1);
    if (wrong != 0) return 1;
    frames();
    refused_message();
    {
        const uint8 idx = (uint8)ecx_getindex(PORT);
        (void)build(idx, 0x5555);
        MUST(ecx_outframe(PORT, idx, 0) > 0); /* on the wire while the master ends */
    }
    ecx_close(CTX);
    printf("%d wrong\n", wrong);
    return wrong == 0 ? 0 : 1;
}
