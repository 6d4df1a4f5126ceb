// The commands. Each returns the exit code of the program, and has reported every error.
#pragma once

namespace margay::ethercat {

class Call;

int run_alias(Call& call);
int run_analyse(Call& call);
int run_config(Call& call);
int run_crc(Call& call);
int run_cstruct(Call& call);
int run_data(Call& call);
int run_debug(Call& call);
int run_domains(Call& call);
int run_download(Call& call);
int run_eoe(Call& call);
int run_foe_read(Call& call);
int run_foe_write(Call& call);
int run_graph(Call& call);
int run_ip(Call& call);
int run_master(Call& call);
int run_pdos(Call& call);
int run_reg_read(Call& call);
int run_reg_write(Call& call);
int run_rescan(Call& call);
int run_sdos(Call& call);
int run_sii_read(Call& call);
int run_sii_write(Call& call);
int run_slaves(Call& call);
int run_soe_read(Call& call);
int run_soe_write(Call& call);
int run_states(Call& call);
int run_upload(Call& call);
int run_version(Call& call);
int run_xml(Call& call);

}  // namespace margay::ethercat
